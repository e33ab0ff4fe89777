"""Mirror pairs: do those of robot.toml agree with where the joints are and how they turn?"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from humanoid_getup.robot_check.finding import Finding
from robots import Robot
from robots.kinematics import place
from robots.model_import.symmetry import MIRROR, MIRROR_AXIS
from robots.quaternion import Array

CLEAR = 0.5  # cosine from which an axis is said to turn one way or the other
FAR = 0.15  # share of the neck height by which a joint may be off its mirror image's place
UNEQUAL = np.radians(5.0)


def check_mirrors(robot: Robot) -> Iterator[Finding]:
    """Find pairs of joints that do not mirror each other."""
    model = robot.spec().compile()
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    torso = robot.layout(model).torso
    axes = data.xmat[torso].reshape(3, 3)
    ids = [model.joint(name).id for name in robot.joint_names]
    anchors = (data.xanchor[ids] - data.xpos[torso]) @ axes
    turns = data.xaxis[ids] @ axes
    found = [*_compare(robot, anchors, turns)]
    yield from found
    if not found:
        pairs = int(np.sum(robot.mirror_index != np.arange(robot.n))) // 2
        yield Finding(
            level="ok",
            subject="mirror",
            text=f"{pairs} pairs and their signs agree with the model",
        )


def _compare(robot: Robot, anchors: Array, turns: Array) -> Iterator[Finding]:
    images, turned = anchors * MIRROR, turns * MIRROR_AXIS
    for k, name in enumerate(robot.joint_names):
        other = int(robot.mirror_index[k])
        if other < k:
            continue
        subject = f"joint '{name}'"
        apart = float(np.linalg.norm(images[k] - anchors[other])) / robot.standing_neck_height
        along = float(turned[k] @ turns[other])
        partner = "itself" if other == k else f"'{robot.joint_names[other]}'"
        if apart > FAR and abs(along) < CLEAR:
            yield Finding(
                level="warning",
                subject=subject,
                text=f"its mirror is {partner}, which is elsewhere and turns about another axis",
                remedy="set mirror in robot.toml",
            )
        elif abs(along) > CLEAR and np.sign(along) != robot.mirror_sign[k]:
            yield Finding(
                level="fault",
                subject=subject,
                text=f"mirror_sign is {robot.mirror_sign[k]:+.0f}, but its axis says "
                f"{np.sign(along):+.0f} for its mirror {partner}",
                remedy="set mirror_sign of both in robot.toml",
            )
        else:
            yield from _compare_ranges(robot, k, other)


def _compare_ranges(robot: Robot, k: int, other: int) -> Iterator[Finding]:
    sign = robot.mirror_sign[k]
    expected = np.sort(sign * np.array([robot.lower[k], robot.upper[k]]))
    if k != other and np.abs(expected - [robot.lower[other], robot.upper[other]]).max() > UNEQUAL:
        low, high = np.degrees([robot.lower[other], robot.upper[other]])
        yield Finding(
            level="warning",
            subject=f"joint '{robot.joint_names[other]}'",
            text=f"its range is {low:.0f} to {high:.0f} deg, that of its mirror "
            f"'{robot.joint_names[k]}' would be {np.degrees(expected[0]):.0f} to "
            f"{np.degrees(expected[1]):.0f} deg",
            remedy="set the same range on both sides in the model, or nothing if they differ",
        )
