"""Trials: keyframes played in simulation, and cost and success of rollouts of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.lying import (
    LYING_TIME,
    MAX_DESCENT,
    MAX_LEAN,
    Lying,
    LyingSide,
    measure_lying,
)
from humanoid_getup.experiments.judging.outcome import DEEP_OVERLAP, Outcome, compute_progress
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import (
    HOLD_TIME,
    MAX_TILT,
    Stance,
    Stand,
    compute_uprightness,
)
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from humanoid_getup.motions.course import record_motion
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import NO_END, STANDING, Motion
from humanoid_getup.motions.preference import Preference
from humanoid_getup.simulation.world import World, find_touching_bodies
from robots import FULL_TORQUE, Robot, TorqueLimit
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


ANGLE_STEP, TIME_STEP = 0.12, 0.12  # first step sizes: rad, and share of a duration
SEARCH_HOLD = 1.0  # s of stand or of lying still that a candidate must show; 3.0 when judged
TRAVEL_COST = 0.02  # per radian that targets travel, mean of all joints
SWAY_TIME = 0.2  # s between the last target and the stand that counts
OVERLAP_COST = 1.0  # of a rollout that overlaps itself from start to end
FAILURE = 6.0  # least cost of a failure; every success costs less
PREFERENCE_SHARE = 0.3  # of a preference's cost, so that no success costs as much as a failure
DESCENT_COST = 6.0  # per m/s of the neck's fastest descent, of a robot that lies down


def score(
    record: Record,
    world: World,
    keyframes: Keyframes,
    hold: float,
    preference: Preference | None = None,
    duration: Array | None = None,
) -> tuple[Array, np.ndarray]:
    """Compute the cost of each rollout, (N,), and whether it succeeded, (N,).

    ``duration`` [s], (N,), is that of the keyframes in each; ``None`` for those given.
    """
    outcome = Outcome(record, world.robot, hold_time=hold - record.period)
    if keyframes.end_class == STANDING:
        missed, succeeded = _miss_stand(outcome, hold)
        time = np.where(succeeded, outcome.stand_time, 0.0)
    else:
        missed, succeeded = _miss_lying(record, keyframes.end_class)
        time = np.full(len(missed), keyframes.duration.sum()) if duration is None else duration
    assert record.target is not None and record.overlap is not None
    travel = np.abs(np.diff(record.target, axis=1)).sum(axis=1).mean(axis=1)
    effort = TRAVEL_COST * travel + OVERLAP_COST * np.mean(record.overlap > DEEP_OVERLAP, axis=1)
    if preference is None:
        preferred = keyframes.time_cost * time + keyframes.torque_cost * outcome.rms_torque
    else:
        preferred = PREFERENCE_SHARE * preference.cost(outcome, time)
    return missed + effort + preferred, succeeded


def _miss_lying(record: Record, side: LyingSide) -> tuple[Array, np.ndarray]:
    """Return the cost of deviations from lying as intended, and whether each rollout lies, (N,)."""
    lying = measure_lying(record, side)
    missed = FAILURE + np.minimum(lying.lean, 2.0) + np.minimum(lying.sway, 1.0)
    return np.where(lying.lies, 0.0, missed) + DESCENT_COST * lying.descent, lying.lies


def _miss_stand(outcome: Outcome, hold: float) -> tuple[Array, np.ndarray]:
    """Return the cost of not standing at the end for a time [s], and whether each stands, (N,)."""
    upright, last = outcome.record.upright, round(hold / outcome.record.period)
    near = compute_uprightness(outcome.record.stance, outcome.robot)
    best = np.array([np.convolve(row, np.full(25, 1 / 25), "valid").max() for row in near])
    progress = compute_progress(near[:, -last:].mean(axis=1), best)
    held = upright[:, -last:].mean(axis=1)
    missed = FAILURE + 4.0 * (1.0 - progress) + 2.0 * (1.0 - held)
    return np.where(outcome.stood, 0.0, missed), outcome.stood


class KeyframePopulation:
    """Samples candidates about keyframes, and moves towards those that cost least."""

    def __init__(
        self, keyframes: Keyframes, robot: Robot, *, size: int, seed: int, step: float = 1.0
    ) -> None:
        """Begin at keyframes, with a first standard deviation in steps of times and angles."""
        self._keyframes, self._robot = keyframes, robot
        self._scale = np.full(len(keyframes.genes), ANGLE_STEP)
        self._scale[: len(keyframes.duration)] = TIME_STEP
        keep_matplotlib_out_of_home()  # cma imports it
        import cma

        options = {"popsize": size, "seed": seed + 1, "verbose": -9}
        self._evolution = cma.CMAEvolutionStrategy(keyframes.genes / self._scale, step, options)
        self._genes: list[Array] = []

    def ask(self) -> list[Keyframes]:
        """Sample the candidates of the next generation."""
        self._genes = self._evolution.ask()
        return [self._decode(genes) for genes in self._genes]

    def tell(self, cost: Array) -> None:
        """Take the costs of the candidates that were sampled last, (size,)."""
        self._evolution.tell(self._genes, cost.tolist())

    @property
    def mean(self) -> Keyframes:
        """Return the mean keyframes of the population."""
        return self._decode(self._evolution.mean)

    def _decode(self, genes: Array) -> Keyframes:
        return self._keyframes.with_genes(genes * self._scale, self._robot)
