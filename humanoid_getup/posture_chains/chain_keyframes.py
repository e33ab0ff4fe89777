"""Keyframes of a chain: its postures and rests as keys that a person can read and change."""

from __future__ import annotations

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import StartClass
from humanoid_getup.posture_chains.resting_state import PostureChain
from robots import Robot

TIME_COST, TORQUE_COST = 0.5, 1.0  # of a motion that is optimized later
STILL = np.radians(0.01)  # change of a target below which a joint does not move
FOUND = "found"
"""Strategy of a chain until it is known what it passes."""


def make_keyframes(
    chain: PostureChain, robot: Robot, *, name: str, start_class: StartClass, rest: float
) -> Keyframes:
    """Make keyframes of a chain, with a rest [s] after each move; the last key is the stance.

    Between two keys at rest the targets move as those of the chain.
    """
    keys, durations = [chain.held], list[float]()
    for move in chain.moves:
        keys += [*move.knots, move.target]
        durations += [move.duration / len(move.knots)] * len(move.knots) + [rest]
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
