"""Scoring: what a rollout of keyframes costs, and whether it ended as it should."""

from __future__ import annotations

import numpy as np

from humanoid_getup.experiments.lying import LyingSide, measure_lying
from humanoid_getup.experiments.play import Trace
from humanoid_getup.experiments.rise_figures import DEEP_OVERLAP, RiseFigures
from humanoid_getup.experiments.standing import (
    compute_progress,
    compute_uprightness,
    is_upright,
    measure_stance,
)
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import STANDING
from humanoid_getup.motions.preference import Preference
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

ANGLE_STEP, TIME_STEP = 0.12, 0.12  # first step size: rad, and share of a duration
SEARCH_HOLD = 1.0  # s of stand or of lying still that a candidate must show; 3.0 when judged
TRAVEL_COST = 0.02  # of a radian that the targets of a joint travel, on average
SWAY_TIME = 0.2  # s between the last target and the stand that counts
SEARCH_TIMESTEP = 0.004  # s; the result is judged, recorded and verified at 0.002
OVERLAP_COST = 1.0  # of pressing into itself all the time
FAILURE = 6.0  # cost that no success can reach
PREFERENCE_SHARE = 0.3  # of a preference's cost, so that no success costs as much as a failure
DESCENT_COST = 6.0  # of a meter per second at which the neck of a robot that lies down descends


def score(
    trace: Trace,
    world: World,
    keyframes: Keyframes,
    hold: float,
    preference: Preference | None = None,
    duration: Array | None = None,
) -> tuple[Array, np.ndarray]:
    """Compute the cost of each rollout, (N,), and whether it ended as it should, (N,).

    ``duration`` [s], (N,), is that of the keyframes in each; ``None`` for those given.
    """
    if keyframes.end_class == STANDING:
        missed, succeeded, time = _judge_rise(trace, world, hold)
    else:
        missed, succeeded = _judge_lying_down(trace, world, keyframes.end_class)
        time = np.full(len(missed), keyframes.duration.sum()) if duration is None else duration
    travel = np.abs(np.diff(trace.target, axis=1)).sum(axis=1).mean(axis=1)
    collides = np.mean(trace.overlap > DEEP_OVERLAP, axis=1)
    effort = TRAVEL_COST * travel + OVERLAP_COST * collides
    figures = RiseFigures.of_trace(trace, world, time)
    if preference is None:
        preferred = keyframes.time_cost * time + keyframes.torque_cost * figures.rms_torque
    else:
        preferred = PREFERENCE_SHARE * preference.cost(figures)
    return missed + effort + preferred, succeeded


def _judge_lying_down(trace: Trace, world: World, side: LyingSide) -> tuple[Array, np.ndarray]:
    lying = measure_lying(world, trace, side)
    missed = FAILURE + np.minimum(lying.lean, 2.0) + np.minimum(lying.sway, 1.0)
    return np.where(lying.lies, 0.0, missed) + DESCENT_COST * lying.descent, lying.lies


def _judge_rise(trace: Trace, world: World, hold: float) -> tuple[Array, np.ndarray, Array]:
    """Return what failures cost, which rollouts stood, and since when [s]; 0 for failures."""
    robot, period = world.robot, trace.period
    stance = measure_stance(world, trace)
    upright = is_upright(stance, robot)
    last = round(hold / period)
    stood = np.asarray(upright[:, -last:].all(axis=1))
    begin = (upright.shape[1] - np.argmax(~upright[:, ::-1], axis=1)) * period
    near = compute_uprightness(stance, robot)
    best = np.array([np.convolve(row, np.full(25, 1 / 25), "valid").max() for row in near])
    progress = compute_progress(near[:, -last:].mean(axis=1), best)
    held = upright[:, -last:].mean(axis=1)
    missed = FAILURE + 4.0 * (1.0 - progress) + 2.0 * (1.0 - held)
    return np.where(stood, 0.0, missed), stood, np.where(stood, begin, 0.0)
