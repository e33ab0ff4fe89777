"""Plans: a strategy makes a plan for a start, and the plan makes a controller."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Protocol, runtime_checkable

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from drivers import State
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.preference import PreferenceName
from humanoid_getup.playback.preflight import Verdict, preflight
from humanoid_getup.playback.supervisor import Supervisor, supervise_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.style.curve_tracker import StyleFigures
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


class RolloutFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A planned rise in its own rollout."""

    stand_time_s: float
    peak_torque_nm: float
    peak_braking_torque_nm: float
    rms_torque_nm: float
    neck_delta_v_m_s: float | None
    self_overlap_m: float | None


@dataclass(frozen=True, kw_only=True)
class PlanFigures(StyleFigures):
    """The figures of a plan; None for those that it does not have."""

    planned: bool
    plan_s: float
    filter_s: float
    rollouts: int
    rounds: int
    robust: float | None
    connection: str | None
    strategy: str | None
    policy: str | None = None
    style: str | None = None
    balanced: bool | None = None
    keys: list[KeyFigures]
    prefer: PreferenceName | None
    search_budget_s: float | None
    searched_s: float | None
    rollout: RolloutFigures | None
    rollout_before_improvement: RolloutFigures | None


@dataclass(frozen=True, kw_only=True)
class SearchRecord:
    """Record of the search for a rise."""

    prefer: PreferenceName
    budget: float
    """Simulated time that was permitted [s]."""
    simulated: float = 0.0
    """Simulated time of searches and improvement [s]."""
    outcome: Outcome | None = None
    """Outcome of the rise to play, in its own rollout; None if none stood."""
    before: Outcome | None = None
    """Outcome of the rise before its improvement; None if it was not improved."""


MOTION = "motion.npz"


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
class RisePlan:
    """The result of planning a rise; this base class has nothing to play."""

    status: RiseStatus
    detail: str = ""
    """Details of the status; may be empty."""
    connection: Connection | None = None
    planned: bool = False
    """Whether a path to a connecting posture was found."""
    stand_time: float = math.nan
    """Start to held stand in the rollout [s]; nan without one."""
    robust: float = math.nan
    """Share of the disturbed rollouts that stood; nan without any."""
    rollouts: int = 0
    rounds: int = 0
    plan_s: float = 0.0
    """Wall time of the first round's selection, planning and smoothing [s]."""
    filter_s: float = 0.0
    """Wall time of everything after that [s]."""
    search: SearchRecord | None = None
    """Record of the search; ``None`` without a search."""
    keys: tuple[KeyRecord, ...] = ()
    """Results of the requested key postures."""
    balanced: bool = True
    """Whether the torso's attitude may be fed back to the ankles, in the rise and in its stand."""

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
        """Return the name of the motion or policy to play; empty if there is none."""
        return ""

    @property
    def label(self) -> str:
        """Return the kind of rise, for pictures."""
        return self.title

    def controller(self, _strategy: Strategy) -> Supervisor | None:
        """Make the supervised controller of this plan; ``None`` if there is nothing to play."""
        return None

    def preflight(
        self, _strategy: Strategy, _settled: State, _measure: Callable[[], Posture]
    ) -> Verdict:
        """Judge the plan with torque off.

        Supply and temperatures are those of the last measurement of the settled robot, as a bus
        polls them in turns and a first measurement may lack some. The posture is measured again,
        because planning takes time.
        """
        return Verdict()

    def open_loop(self) -> RisePlan | None:
        """Return the plan without feedback while it is played; ``None`` if it has none."""
        return None

    def save(self, _folder: Path) -> None:
        """Save the plan's motion, if it has one, in a folder."""

    def figures(self) -> PlanFigures:
        """Return the figures of the plan."""
        joined = self.connection.motion if self.connection else None
        search = self.search
        before, after = (search.before, search.outcome) if search else (None, None)
        return PlanFigures(
            planned=self.planned,
            plan_s=self.plan_s,
            filter_s=self.filter_s,
            rollouts=self.rollouts,
            rounds=self.rounds,
            robust=None if math.isnan(self.robust) else self.robust,
            connection=joined and joined.name,
            strategy=joined and joined.strategy,
            keys=[key.figures for key in self.keys],
            prefer=search and search.prefer,
            search_budget_s=search and search.budget,
            searched_s=search and search.simulated,
            rollout=after and after.figures(RolloutFigures),
            rollout_before_improvement=before and before.figures(RolloutFigures),
        )


@dataclass(frozen=True, kw_only=True)
class MotionPlan(RisePlan):
    """A motion from the lying posture to the stand."""

    motion: Motion
    simulated: bool = True
    """Whether the joint angles come from a rollout; if not, they are only targets, and no
    monitor expects the robot to reach them."""

    @property
    def title(self) -> str:
        """Return the name of the motion."""
        return self.motion.name

    @property
    def label(self) -> str:
        """Return the motion's kind of rise."""
        return self.motion.strategy

    def controller(self, strategy: Strategy) -> Supervisor:
        """Make the supervised player of the motion."""
        return supervise_motion(
            strategy.world,
            self.motion,
            torque_limit=strategy.torque_limit.value,
            tracked=self.simulated,
            balanced=self._is_balanced,
        )

    def preflight(
        self, strategy: Strategy, settled: State, measure: Callable[[], Posture]
    ) -> Verdict:
        """Roll the motion out from the present posture, and judge it."""
        return preflight(
            strategy.world,
            self.motion,
            voltage=settled.voltage,
            torque_limit=strategy.torque_limit,
            temperature=settled.temperature,
            start=measure(),
            balanced=self._is_balanced,
        )

    @property
    def _is_balanced(self) -> bool:
        """Return whether the rise is played with feedback."""
        return self.balanced and self.simulated and self.motion.rises

    def open_loop(self) -> RisePlan | None:
        """Return the plan without the feedback to the ankles; ``None`` if it has none."""
        return replace(self, balanced=False) if self._is_balanced else None

    def figures(self) -> PlanFigures:
        """Return the figures of the plan."""
        return replace(super().figures(), balanced=self._is_balanced)

    def save(self, folder: Path) -> None:
        """Save the motion."""
        self.motion.save(folder / MOTION)


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

    def plan(self, start: Posture, rng: np.random.Generator, /) -> RisePlan:
        """Plan a rise from a posture at rest."""
        ...
