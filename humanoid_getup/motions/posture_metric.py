"""The posture metric: equations (1) to (3) of [Lin12]."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robots import Posture, Robot, quaternion
from robots.quaternion import Array

ROOT_WEIGHT = 5.0
SEGMENT_WEIGHT = {
    "head": 0.5,
    "wrist": 0.5,
    "hand": 0.3,
    "finger": 0.1,
    "thumb": 0.1,
    "foot": 0.7,
    "toes": 0.1,
    "other": 1.0,
}
"""Weights of [Lin12], section 5, by `Joint.segment`."""


def best_yaw(q: Array, reference: Array) -> Array:
    """Compute the rotation about the vertical [rad] that brings ``q`` closest to ``reference``.

    With r = q reference^-1 the turn z(psi) leaves a rotation whose scalar part is
    r_w cos(psi/2) - r_z sin(psi/2), largest in size at tan(psi/2) = -r_z / r_w.
    """
    r = quaternion.multiply(q, quaternion.inverse(reference))
    yaw = -2.0 * np.arctan2(r[..., 3], r[..., 0])
    return np.arctan2(np.sin(yaw), np.cos(yaw))


def aligned_orientation_distance(q1: Array, q2: Array) -> Array:
    """Compute dis_Q = |log(q1^-1 q2)| (2) of unit quaternions (..., 4) after the best yaw.

    The length of the logarithm is half the angle of the rotation. What the best yaw leaves is the
    swing of r about a horizontal axis, so the distance is half the angle between the directions
    of gravity in the two root frames, in [0, pi/2].
    """
    r = quaternion.multiply(q2, quaternion.inverse(q1))
    return np.arctan2(np.hypot(r[..., 1], r[..., 2]), np.hypot(r[..., 0], r[..., 3]))


def measure_tilt(q1: Array, q2: Array) -> float:
    """Measure the angle between the directions of gravity in two root frames (4,) [rad]."""
    return 2.0 * float(aligned_orientation_distance(q1, q2))


def align(posture: Posture, reference: Posture) -> Posture:
    """Turn and shift a posture over the ground until its root is closest to the reference's."""
    turn = quaternion.from_yaw(best_yaw(posture.orientation, reference.orientation))
    return replace(
        posture,
        position=np.array([*reference.position[:2], posture.position[2]]),
        orientation=quaternion.multiply(turn, posture.orientation),
    )


@dataclass(frozen=True, kw_only=True)
class PostureMetric:
    """The posture metric with the weights of one robot."""

    joint_weight: Array
    """w_i of equation (3), shape (n,)."""
    root_weight: float = ROOT_WEIGHT
    """w_q of equation (1)."""

    @classmethod
    def of(cls, robot: Robot) -> PostureMetric:
        """Weigh the robot's joints by their segments as the paper does."""
        return cls(joint_weight=np.array([SEGMENT_WEIGHT[j.segment] for j in robot.joints]))

    def distance(self, q1: Array, v1: Array, q2: Array, v2: Array) -> Array:
        """Compute the distance (1) of orientations (..., 4) and joint angles (..., n).

        It is the sum of dis_Q and dis_V (3), free of position and heading, which are aligned
        first.
        """
        joints = np.sqrt(np.sum(self.joint_weight * (v1 - v2) ** 2, axis=-1))
        return self.root_weight * aligned_orientation_distance(q1, q2) + joints

    def between(self, a: Posture, b: Posture) -> float:
        """Compute the distance of two postures."""
        return float(self.distance(a.orientation, a.joint_pos, b.orientation, b.joint_pos))
