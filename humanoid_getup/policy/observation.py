"""The observation space: how measurements become a policy's input.

Training and robot call the same functions, on a thousand robots or on one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.action import ActionSpec
from robots import Robot
from robots.quaternion import Array
from robots.validation import whole

Floats = NDArray[np.float32]
"""Type of a network's input."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """How left and right are exchanged in a vector: ``vector[..., index] * sign``."""

    index: NDArray[np.int_]
    sign: Array

    @staticmethod
    def join(parts: Sequence[Mirror]) -> Mirror:
        """Join the mirrors of a vector's parts."""
        starts = np.cumsum([0, *(len(part.index) for part in parts)])
        return Mirror(
            index=np.concatenate([p.index + s for p, s in zip(parts, starts, strict=False)]),
            sign=np.concatenate([part.sign for part in parts]),
        )

    def __call__(self, vector: Array) -> Array:
        """Exchange left and right, (..., size)."""
        return vector[..., self.index] * self.sign


VECTOR = Mirror(np.arange(3), np.array([1.0, -1.0, 1.0]))
"""Mirror of a direction or a velocity: y changes."""
ROTATION = Mirror(np.arange(3), np.array([-1.0, 1.0, -1.0]))
"""Mirror of a rotation or an angular velocity: x and z change."""
SAME = Mirror(np.arange(1), np.ones(1))
"""Mirror of a number that does not change."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensed:
    """Measurements of one robot or of many: first axes (...)."""

    gravity: Array
    """Direction of gravity in the torso, (..., 3)."""
    gyro: Array
    """Angular velocity in the torso's frame [rad/s], (..., 3)."""
    joint_pos: Array
    """[rad], (..., n)"""
    joint_vel: Array
    """[rad/s], (..., n)"""


@dataclass(frozen=True)
class Term:
    """A named part of the observation."""

    name: str
    size: Annotated[int, whole(1, 10_000)]


def list_terms(robot: Robot, action: ActionSpec) -> tuple[Term, ...]:
    """List the parts of the observation, in their order."""
    return (
        Term("gravity", 3),
        Term("gyro", 3),
        Term("joint_pos", robot.n),
        Term("joint_vel", robot.n),
        Term("target_error", robot.n),
        Term("last_action", action.size),
        Term("torque_share", 1),
    )


def compute_torque_share(robot: Robot, action: ActionSpec, torque_limit: Array | float) -> Array:
    """Compute the observation of a torque limit on every servo [N·m], (...) to (..., 1).

    It saturates at the torque of the strongest servo, or at the policy's own PWM limit.
    """
    return np.minimum(torque_limit / robot.max_torque.max(), action.pwm_limit)[..., None]


def observe(
    robot: Robot, sensed: Sensed, target: Array, last_action: Array, torque_share: Array
) -> Floats:
    """Build an observation, (..., size), whose joint angles are counted from standing.

    The present targets are (..., n) [rad], the numbers of the last policy step (..., k), and
    the torque limit as a share of the servos' own (..., 1).
    """
    return np.concatenate(
        (
            sensed.gravity,
            sensed.gyro,
            sensed.joint_pos - robot.standing.joint_pos,
            sensed.joint_vel,
            target - sensed.joint_pos,
            last_action,
            torque_share,
        ),
        axis=-1,
        dtype=np.float32,
        casting="same_kind",
    )


def mirror_of_observation(robot: Robot, action: ActionSpec) -> Mirror:
    """Build the exchange of left and right in observations."""
    joints = Mirror(robot.mirror_index, robot.mirror_sign)
    actions = Mirror(np.arange(action.size), action.mirror_sign(robot))
    return Mirror.join((VECTOR, ROTATION, joints, joints, joints, actions, SAME))
