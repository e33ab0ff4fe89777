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
from humanoid_getup.style.curves import LOOKAHEAD
from humanoid_getup.style.features import COUNT as FEATURE_COUNT
from humanoid_getup.style.features import GRID
from robots import Robot
from robots.quaternion import Array
from robots.storage.validation import whole

Floats = NDArray[np.float32]
"""Type of a network's input."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """The exchange of left and right in a vector: ``vector[..., index] * sign``."""

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
MAP = Mirror(np.arange(GRID**2).reshape(GRID, GRID)[:, ::-1].ravel(), np.ones(GRID**2))
"""Mirror of the height map: each row is turned over."""
UPRIGHT = np.array([0.0, np.pi / 2, np.pi / 2])
"""Zero of the style features: no height, and the angles of an upright torso."""


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


@dataclass(frozen=True, kw_only=True)
class StyleInput:
    """Inputs of a policy with style curves, besides its sensors."""

    memory: Annotated[int, whole(1, 10_000)]
    """Size of the network's memory of its last actions."""
    height_map: bool = False
    """Whether it observes the ground around it, where that is known."""


def list_terms(
    robot: Robot, action: ActionSpec, style: StyleInput | None = None, memory: int = 0
) -> tuple[Term, ...]:
    """List the terms of the observation in order; with style curves there are more.

    The memory is that of a network without style curves; 0 if it has none.
    """
    terms = (
        Term("gravity", 3),
        Term("gyro", 3),
        Term("joint_pos", robot.n),
        Term("joint_vel", robot.n),
        Term("target_error", robot.n),
        Term("last_action", style.memory if style else memory or action.size),
        Term("torque_share", 1),
    )
    if style is None:
        return terms
    terms += (Term("style_targets", FEATURE_COUNT * len(LOOKAHEAD)),)
    terms += (Term("style_features", FEATURE_COUNT),)
    return (*terms, Term("height_map", GRID**2)) if style.height_map else terms


def compute_torque_share(robot: Robot, action: ActionSpec, torque_limit: Array | float) -> Array:
    """Compute the observation of a torque limit on every servo [N·m], (...) to (..., 1).

    It saturates at the torque of the strongest servo, or at the policy's own PWM limit.
    """
    return np.minimum(torque_limit / robot.max_torque.max(), action.pwm_limit)[..., None]


def observe(
    robot: Robot,
    sensed: Sensed,
    target: Array,
    memory: Array,
    torque_share: Array,
    more: Sequence[Array] = (),
) -> Floats:
    """Build an observation, (..., size), whose joint angles are counted from standing.

    The present targets are (..., n) [rad], the policy's memory of its last actions (..., k), and
    the torque limit as a share of the servos' own (..., 1). More are the terms of style, of
    :func:`observe_style`, and the height map.
    """
    return np.concatenate(
        (
            sensed.gravity,
            sensed.gyro,
            sensed.joint_pos - robot.standing.joint_pos,
            sensed.joint_vel,
            target - sensed.joint_pos,
            memory,
            torque_share,
            *more,
        ),
        axis=-1,
        dtype=np.float32,
        casting="same_kind",
    )


def observe_style(targets: Array, features: Array) -> tuple[Array, Array]:
    """Build the terms of style: targets (..., 4, 3) as (..., 12), and measured features (..., 3).

    Angles are counted from a quarter turn, so that a mirror image changes a sign.
    """
    flat = (*targets.shape[:-2], targets.shape[-2] * targets.shape[-1])
    return (targets - UPRIGHT).reshape(flat), features - UPRIGHT


def mirror_of_observation(robot: Robot, memory: Mirror, style: StyleInput | None = None) -> Mirror:
    """Build the exchange of left and right in observations, from that in a policy's memory."""
    joints = Mirror(robot.mirror_index, robot.mirror_sign)
    parts = [VECTOR, ROTATION, joints, joints, joints, memory, SAME]
    if style is not None:
        parts += [VECTOR] * (len(LOOKAHEAD) + 1)  # of features, the side angle changes
        parts += [MAP] if style.height_map else []
    return Mirror.join(parts)
