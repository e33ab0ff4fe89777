"""Keyframes of a chain: its postures and rests as keys that a person can read and change."""

from __future__ import annotations

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import FOUND, StartClass
from humanoid_getup.posture_chains.resting_state import PostureChain
from robots import Robot
from robots.smooth_step import invert_smooth_step

TIME_COST, TORQUE_COST = 0.5, 1.0  # where a motion is optimized
STILL = np.radians(0.01)  # change of a target below which a joint does not move


def make_keyframes(
    chain: PostureChain, robot: Robot, *, name: str, start_class: StartClass, rest: float
) -> Keyframes:
    """Make keyframes of a chain, with a rest [s] after each move; the last key is the stance.

    Between two keys at rest the targets move as those of the chain.
    """
    keys, durations = [chain.held], list[float]()
    for move in chain.moves:
        keys += [*move.knots, move.target]
        # A move is a smooth step over all its knots: the first and the last take longer.
        at = invert_smooth_step(np.linspace(0.0, 1.0, len(move.knots) + 1))
        durations += [*move.duration * np.diff(at), rest]
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
