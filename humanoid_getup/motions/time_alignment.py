"""Alignment in time: how far two motions are apart where one may be quicker than the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.motions.retarget_clip import RetargetedClip
from robots import Robot
from robots.body.limbs import Limbs
from robots.quaternion import Array

Rows = NDArray[np.int_]
SAMPLES = 60  # of each motion


def align(cost: Array) -> Rows:
    """Find the cheapest way through the costs (T, S) of pairs, by dynamic time warping.

    Returns its pairs of rows and columns, (P, 2), from the first ones to the last ones.
    """
    rows, columns = cost.shape
    total = np.full((rows + 1, columns + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(rows):
        for j in range(columns):
            before = min(total[i, j], total[i, j + 1], total[i + 1, j])
            total[i + 1, j + 1] = cost[i, j] + before
    pairs, i, j = [(rows - 1, columns - 1)], rows, columns
    while i > 1 or j > 1:
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        i, j = min(steps, key=lambda step: total[step])
        pairs.append((i - 1, j - 1))
    return np.array(pairs[::-1])


def measure_distance(motion: Motion, other: Motion, metric: PostureMetric) -> float:
    """Measure the mean distance of two rises up to their stands, aligned in time.

    It is that of [Lin12], equation (1), which is free of place and heading.
    """
    a, b = _sample_way(motion), _sample_way(other)
    cost = metric.distance(
        a.orientation[:, None], a.joint_pos[:, None], b.orientation[None], b.joint_pos[None]
    )
    pairs = align(cost)
    return float(cost[pairs[:, 0], pairs[:, 1]].mean())


def find_nearest(
    motion: Motion, others: Sequence[Motion], metric: PostureMetric
) -> tuple[float, Motion] | None:
    """Find the nearest of some rises, and its distance; None without any."""
    found = [(measure_distance(motion, other, metric), other) for other in others]
    return min(found, key=lambda pair: pair[0]) if found else None


def measure_limb_error(motion: Motion, clip: RetargetedClip, robot: Robot) -> float:
    """Measure the mean angle of a motion's limbs to those of a clip, aligned in time [rad]."""
    limbs, rows = Limbs(robot), _choose(len(motion.time))
    wanted = np.concatenate([*clip.limbs.values()], axis=1)  # (S, 2 L, 3)
    wanted = wanted[_choose(len(wanted))]
    found = np.array(
        [
            [part for name in clip.limbs for part in (pose[name].upper, pose[name].lower)]
            for pose in (limbs.measure(angles) for angles in motion.joint_pos[rows])
        ]
    )  # (T, 2 L, 3)
    angle = np.arccos(np.clip(np.einsum("tli,sli->tsl", found, wanted), -1.0, 1.0)).mean(axis=2)
    pairs = align(angle)
    # Each posture of the clip counts once, however long the robot stays near it.
    return float(np.mean([angle[pairs[pairs[:, 1] == s, 0], s].mean() for s in range(len(wanted))]))


def _sample_way(motion: Motion) -> Trajectory:
    stand = motion.duration if motion.stand_time is None else motion.stand_time
    count = max(int(np.searchsorted(motion.time - motion.time[0], stand)), 2)
    rows = _choose(min(count, len(motion.time)))
    return Trajectory(
        time=motion.time[rows],
        position=motion.position[rows],
        orientation=motion.orientation[rows],
        joint_pos=motion.joint_pos[rows],
    )


def _choose(count: int) -> Rows:
    return np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).round().astype(int))
