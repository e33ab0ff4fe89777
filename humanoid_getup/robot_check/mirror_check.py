"""Mirror pairs: do those of robot.toml agree with where the joints are and how they turn?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from humanoid_getup.robot_check.finding import Finding
from robots import Robot
from robots.body.limbs import Limbs
from robots.body.mirror_pairs import MIRROR, MIRROR_AXIS
from robots.quaternion import Array

CLEAR = 0.5  # cosine from which an axis is said to turn one way or the other
FAR = 0.15  # share of the neck height by which a joint may be off its mirror image's place
UNEQUAL = np.radians(5.0)


def check_mirrors(limbs: Limbs) -> Iterator[Finding]:
    """Find pairs of joints that do not mirror each other.

    They are looked at with all joints at zero: whatever their signs, that is its own mirror image.
    """
    robot = limbs.robot
    limbs.look(np.zeros(robot.n))
    anchors = np.array([limbs.anchor(k) for k in range(robot.n)])
    axes = np.array([limbs.axis(k) for k in range(robot.n)])
    apart = np.linalg.norm((anchors * MIRROR)[:, None] - anchors, axis=-1)  # (n, n)
    along = (axes * MIRROR_AXIS) @ axes.T  # (n, n): cosine between an image's axis and another's
    found = [*_compare(robot, apart / robot.standing_neck_height, along)]
    yield from found
    if not found:
        pairs = int(np.sum(robot.mirror_index != np.arange(robot.n))) // 2
        text = f"{pairs} pairs and their signs agree with the model"
        yield Finding(level="ok", subject="mirror", text=text)


def _compare(robot: Robot, apart: Array, along: Array) -> Iterator[Finding]:
    is_image = (apart < FAR) & (np.abs(along) > CLEAR)
    for k in range(robot.n):
        other = int(robot.mirror_index[k])
        if other < k:
            continue
        if not is_image[k, other]:
            yield _describe_stranger(robot, k, is_image[k], apart[k])
        elif np.sign(along[k, other]) != robot.mirror_sign[k]:
            yield Finding(
                level="fault",
                subject=f"joint '{robot.joint_names[k]}'",
                text=f"mirror_sign is {robot.mirror_sign[k]:+.0f}, but its axis says "
                f"{np.sign(along[k, other]):+.0f} for its mirror {_partner(robot, k)}",
                remedy="set mirror_sign of both in robot.toml",
            )
        else:
            yield from _compare_ranges(robot, k, other)


def _partner(robot: Robot, k: int) -> str:
    other = int(robot.mirror_index[k])
    return "itself" if other == k else f"'{robot.joint_names[other]}'"


def _describe_stranger(robot: Robot, k: int, is_image: np.ndarray, apart: Array) -> Finding:
    """Tell of a joint whose mirror is elsewhere, or turns about another axis; and what fits."""
    images = np.flatnonzero(is_image)
    text = f"its mirror is {_partner(robot, k)}, which is not its mirror image in the model"
    if not len(images):
        return Finding(
            level="warning",
            subject=f"joint '{robot.joint_names[k]}'",
            text=f"{text}; no joint is",
            remedy="mirrored motions differ by it: accept that, or make the model symmetric",
        )
    fitting = robot.joint_names[int(images[np.argmin(apart[images])])]
    return Finding(
        level="fault",
        subject=f"joint '{robot.joint_names[k]}'",
        text=f"{text}; '{fitting}' is",
        remedy="set mirror of all that are concerned in robot.toml",
    )


def _compare_ranges(robot: Robot, k: int, other: int) -> Iterator[Finding]:
    sign = robot.mirror_sign[k]
    expected = np.sort(sign * np.array([robot.lower[k], robot.upper[k]]))
    if k != other and np.abs(expected - [robot.lower[other], robot.upper[other]]).max() > UNEQUAL:
        low, high = np.degrees([robot.lower[other], robot.upper[other]])
        yield Finding(
            level="warning",
            subject=f"joint '{robot.joint_names[other]}'",
            text=f"its range is {low:.0f} to {high:.0f}°, that of its mirror "
            f"'{robot.joint_names[k]}' would be {np.degrees(expected[0]):.0f} to "
            f"{np.degrees(expected[1]):.0f}°",
            remedy="set the same range on both sides in the model, or nothing if they differ",
        )
