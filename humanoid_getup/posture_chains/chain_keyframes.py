"""Keyframes of a chain: its postures and rests as keys that a person can read and change."""

from __future__ import annotations

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import FOUND, StartClass
from humanoid_getup.posture_chains.resting_state import PostureChain
from robots import Robot
from robots.quaternion import Array
from robots.smooth_step import smooth_step

TIME_COST, TORQUE_COST = 0.5, 1.0  # where a motion is optimized
STILL = np.radians(0.01)  # change of a target below which a joint does not move
TIMED = 2001  # shares of the time at which a move's smooth step is inverted


def make_keyframes(
    chain: PostureChain, robot: Robot, *, name: str, start_class: StartClass, rest: float
) -> Keyframes:
    """Make keyframes of a chain, with a rest [s] after each move; the last key is the stance.

    Between two keys at rest the targets move as those of the chain.
    """
    keys, durations = [chain.held], list[float]()
    for move in chain.moves:
        keys += [*move.knots, move.target]
        durations += [*move.duration * np.diff(_time_knots(len(move.knots))), rest]
    keys[-1] = robot.standing.joint_pos
    moving = np.flatnonzero(np.ptp(keys, axis=0) > STILL)
    free = np.union1d(moving, robot.mirror_index[moving])
    return Keyframes(
        name=name,
        start_class=start_class,
        strategy=FOUND,
        duration=np.array(durations),
        keys=np.array(keys),
        free=free,
        mirrored=np.zeros(len(free), dtype=bool),
        torque_limit=float(robot.max_torque.max()),
        time_cost=TIME_COST,
        torque_cost=TORQUE_COST,
    )


def _time_knots(count: int) -> Array:
    """Return the shares of a move's time at which it is at its start and its knots, (P+1,).

    A move is a smooth step over all its knots: it takes longer to the first and to the last.
    """
    share = np.linspace(0.0, 1.0, TIMED)
    return np.interp(np.linspace(0.0, 1.0, count + 1), smooth_step(share), share)
