"""Scoring: cost and success of rollouts of keyframes."""

from __future__ import annotations

import numpy as np

from humanoid_getup.experiments.judging.lying import LyingSide, measure_lying
from humanoid_getup.experiments.judging.outcome import DEEP_OVERLAP, Outcome, compute_progress
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import compute_uprightness
from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import STANDING
from humanoid_getup.motions.preference import Preference
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.quaternion import Array

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
