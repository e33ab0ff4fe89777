"""A trial: keyframes played once in simulation, undisturbed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.judging.lying import (
    LYING_TIME,
    MAX_DESCENT,
    MAX_LEAN,
    Lying,
    measure_lying,
)
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import (
    HOLD_TIME,
    MAX_TILT,
    Stance,
    Stand,
    compute_uprightness,
)
from humanoid_getup.experiments.rollouts.play import play
from humanoid_getup.motions.course import record_motion
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import NO_END, STANDING, Motion
from humanoid_getup.simulation.world import World, find_touching_bodies
from robots import FULL_TORQUE, TorqueLimit
from robots.kinematics import read_posture
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """One rollout of keyframes."""

    world: World
    keyframes: Keyframes
    start: Array
    """MuJoCo positions at the start, (nq,)."""
    targets: Array
    """Targets sent to the servos [rad], (T, n); the last one is held during judging."""
    outcome: Outcome

    @classmethod
    def of(
        cls, world: World, keyframes: Keyframes, start: Array, limit: TorqueLimit = FULL_TORQUE
    ) -> Trial:
        """Roll keyframes out from MuJoCo positions (nq,), under a torque limit."""
        hold = HOLD_TIME if keyframes.end_class == STANDING else LYING_TIME
        targets = keyframes.targets(world.robot, hold + 1.0)
        record = play(world, Scenarios.nominal(world, start, limit), targets[None]).take(0)
        return cls(
            world=world,
            keyframes=keyframes,
            start=start,
            targets=targets,
            outcome=Outcome(record, world.robot),
        )

    @property
    def succeeded(self) -> bool:
        """Return whether it ended as the keyframes should."""
        return bool(self.stand.stood if self.rises else self._lying.lies)

    @property
    def rises(self) -> bool:
        """Return whether it should end standing."""
        return self.keyframes.end_class == STANDING

    @property
    def stand(self) -> Stand:
        """Return the stand in which it ended, if it did."""
        return self.outcome.stand

    @property
    def progress(self) -> float:
        """Return its best progress to a stand, from 0 to 1."""
        return float(compute_uprightness(self._stance, self.world.robot).max())

    @property
    def figures(self) -> dict[str, float]:
        """Return the figures of a successful trial."""
        if self.rises:
            return {"stand_time_s": float(self.stand.start_time)}
        return {"descent_m_s": float(self._lying.descent)}

    def describe(self) -> str:
        """Describe its end; for a failure the contacts, the neck's height and the time."""
        if not self.rises:
            return self._describe_lying()
        if self.succeeded:
            return f"stood after {self.stand.start_time:.2f} s"
        return self._describe_fall()

    def record(self, provenance: dict[str, str | float | int]) -> Motion:
        """Make a motion of it; its end class is "other" if it failed."""
        robot = self.world.robot
        hold = HOLD_TIME if self.rises else LYING_TIME
        moving = len(self.targets) - round((hold + 0.5) / robot.control_period)
        return record_motion(
            self.world,
            read_posture(robot, self.world.model, self.start),
            self.targets[:moving],
            self.outcome.record.qpos,
            name=self.keyframes.name,
            start_class=self.keyframes.start_class,
            end_class=self.keyframes.end_class if self.succeeded else NO_END,
            strategy=self.keyframes.strategy,
            provenance=provenance | (self.figures if self.succeeded else {}),
        )

    def _describe_fall(self) -> str:
        robot, period = self.world.robot, self.world.robot.control_period
        share = self._stance.neck_height / robot.standing_neck_height
        best, tilt = int(np.argmax(share)), math.degrees(self._stance.tilt[-1])
        text = (
            f"does not end in a held stand: its neck came to {share[best]:.0%} of standing height "
            f"after {(best + 1) * period:.2f} s and ended at {share[-1]:.0%}"
        )
        if tilt > math.degrees(MAX_TILT):
            text += f", tilted by {tilt:.0f}°"
        bodies = find_touching_bodies(self.world, self.outcome.record.qpos[-1])
        if not bodies:
            return f"{text}; it swayed on its feet"
        lifted = np.flatnonzero(~self._stance.non_foot_contact)
        since = 0.0 if len(lifted) == 0 else (lifted[-1] + 1) * period
        on = ", ".join(bodies)
        return f"{text}; on the ground besides the feet since {since:.2f} s, at the end: {on}"

    def _describe_lying(self) -> str:
        lying, side = self._lying, self.keyframes.end_class
        if self.succeeded:
            return f"lay {side} after {self.keyframes.duration.sum():.2f} s"
        return (
            f"does not end lying {side}: {math.degrees(lying.lean):.0f}° off that side "
            f"(expected at most {math.degrees(MAX_LEAN):.0f}°), moving by "
            f"{math.degrees(lying.sway):.0f}° at the end, its neck sank at "
            f"{lying.descent:.2f} m/s (expected at most {MAX_DESCENT:g} m/s)"
        )

    @property
    def _stance(self) -> Stance:
        return self.outcome.record.stance

    @cached_property
    def _lying(self) -> Lying:
        assert self.keyframes.end_class != STANDING
        return measure_lying(self.outcome.record, self.keyframes.end_class)
