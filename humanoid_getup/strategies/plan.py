"""Plans: a strategy makes a plan for a start, and the plan makes a controller."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Protocol, runtime_checkable

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from drivers import State
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.preflight import Verdict, preflight, preflight_robot
from humanoid_getup.playback.supervisor import Supervisor, supervise_motion, supervise_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from humanoid_getup.style.followed_style import FollowedStyle
from humanoid_getup.style.style import Style
from robots import Posture, TorqueLimit


class KeyFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a key posture in a plan, under report.json's keys."""

    name: str
    kept: bool
    time_s: float | None = None
    """Time at which the motion passes it; ``None`` if it does not."""
    largest_joint_error_rad: float | None = None
    """Largest joint error at that instant of the undisturbed rollout."""
    tilt_error_rad: float | None = None
    """Tilt error of the torso at that instant."""
    reason: str = ""
    """Reason why it was dropped; empty if it was kept."""
    played_joint_error_rad: float | UnsetType | None = UNSET
    """Largest joint error in the rise itself; unset if only the plan is known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyRecord:
    """A key posture, and its result in a plan."""

    posture: Posture
    figures: KeyFigures


class RiseStatus(Enum):
    """Result of planning a rise."""

    STOOD = "a rollout ends in a held stand"
    NOT_PLANNED = "no path to any connecting posture"
    FELL = "no rollout ends in a held stand"
    UNFILTERED = "planned, but not filtered"
    STORED = "a stored motion, played as it is"
    LEARNED = "a learned policy"
    MOVES = "a move to where there is room to rise"


@dataclass(frozen=True, kw_only=True)
class RanPolicy:
    """What is left of a policy in another process: no network, so that it cannot be run."""

    style: Style | None
    followed: FollowedStyle | None


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A motion or a policy that gets a robot up, and how it was found; or why there is none.

    In another process, a plan that was pickled has the figures of its policy, and no policy to run.
    """

    status: RiseStatus
    detail: str = ""
    """Details of the status; may be empty."""
    motion: Motion | None = None
    """Motion to play, from the lying posture; None for a policy, or if there is none."""
    tracked: bool = True
    """Whether the joint angles of the motion come from a rollout; if not, they are only targets,
    and no monitor expects the robot to reach them."""
    policy: OnnxPolicy | None = None
    """Policy to run; its torque limit was set when it was loaded."""
    policy_name: str = ""
    connection: Connection | None = None
    planned: bool = False
    """Whether a path to a connecting posture was found."""
    robust: float = math.nan
    """Share of the disturbed rollouts that stood; nan without any."""
    rollouts: int = 0
    rounds: int = 0
    plan_s: float = 0.0
    """Wall time of the first round's selection, planning and smoothing [s]."""
    filter_s: float = 0.0
    """Wall time of everything after that [s]."""
    settings: PlannerSettings | None = None
    """Settings of the search; None without a search, as for the fields below."""
    searched: float = 0.0
    """Simulated time of searches and improvement [s]."""
    rollout: Outcome | None = None
    """Outcome of the motion in its own rollout; None if none stood."""
    before: Outcome | None = None
    """Outcome of the rise before its improvement; None if it was not improved."""
    keys: tuple[KeyRecord, ...] = ()
    """Results of the requested key postures."""
    balanced: bool = True
    """Whether the torso's attitude may be fed back to the ankles, in the rise and in its stand."""

    def __getstate__(self) -> dict[str, Any]:
        policy = self.policy and RanPolicy(style=self.policy.style, followed=self.policy.followed)
        return vars(self) | {"policy": policy}

    def __str__(self) -> str:
        """Describe in one line the motion to play, and how the planning ended."""
        parts = [self.reason]
        if not math.isnan(self.robust):
            parts.append(f"stands in {self.robust:.0%} of its disturbed rollouts")
        return f"{self.title or 'no rise'}: {', '.join(parts)}"

    @property
    def reason(self) -> str:
        """Return in one line how the planning ended."""
        return f"{self.status.value}: {self.detail}" if self.detail else self.status.value

    @property
    def title(self) -> str:
        """Return the name of the motion, or of the policy and its style; empty without any."""
        if self.policy is None:
            return self.motion.name if self.motion else ""
        style = self.policy.style
        return f"policy {self.policy_name}" + (f", style {style.name}" if style else "")

    @property
    def label(self) -> str:
        """Return the kind of rise, for pictures."""
        return self.motion.strategy if self.motion else self.title

    @property
    def is_playable(self) -> bool:
        """Return whether there is a motion to play or a policy to run."""
        return self.motion is not None or self.policy is not None

    @property
    def is_balanced(self) -> bool:
        """Return whether a motion is played with feedback to the ankles."""
        return bool(self.motion and self.motion.rises) and self.balanced and self.tracked

    def controller(self, strategy: Strategy) -> Supervisor | None:
        """Make the supervised controller of this plan; ``None`` if there is nothing to play."""
        if self.policy is not None:
            return supervise_policy(self.policy)
        if self.motion is None:
            return None
        return supervise_motion(
            strategy.world,
            self.motion,
            torque_limit=strategy.torque_limit.value,
            tracked=self.tracked,
            balanced=self.is_balanced,
        )

    def preflight(
        self, strategy: Strategy, settled: State, measure: Callable[[], Posture]
    ) -> Verdict:
        """Judge the plan with torque off: roll a motion out from the present posture.

        Supply and temperatures are those of the last measurement of the settled robot, as a bus
        polls them in turns and a first measurement may lack some. The posture is measured again,
        because planning takes time. What a policy will do is unknown beforehand.
        """
        if self.policy is not None:
            return preflight_robot(strategy.world.robot, settled.voltage, settled.temperature)
        if self.motion is None:
            return Verdict()
        return preflight(
            strategy.world,
            self.motion,
            voltage=settled.voltage,
            torque_limit=strategy.torque_limit,
            temperature=settled.temperature,
            start=measure(),
            balanced=self.is_balanced,
        )

    def open_loop(self) -> Plan | None:
        """Return the plan without feedback while it is played; ``None`` if it has none."""
        return replace(self, balanced=False) if self.is_balanced else None


@runtime_checkable
class Strategy(Protocol):
    """Plans how one robot in one scene gets up, within the torque limit of its servos."""

    @property
    def world(self) -> World:
        """Return robot and scene."""
        ...

    @property
    def torque_limit(self) -> TorqueLimit:
        """Return the torque limit that its plans keep to."""
        ...

    def plan(self, start: Posture, rng: np.random.Generator, /) -> Plan:
        """Plan a rise from a posture at rest."""
        ...
