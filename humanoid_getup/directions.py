"""Which way a joint turns, in words that a person at the robot understands."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from robots import Joint, Robot
from robots.rotation import Array

UPRIGHT_AXIS = 0.8  # share of an axis that points up from which a joint is told as a turn
WAYS = (("backward", "forward"), ("to its right", "to its left"), ("down", "up"))
"""Negative and positive of the robot's x, y and z when it stands."""


def describe_direction(robot: Robot, joint: Joint) -> str:
    """Tell which way the limb behind a joint goes when its angle grows, for a standing robot.

    x is taken to point forward and y to the left, as is the custom.
    """
    axis, lever = _find_axis(robot, joint)
    if abs(axis[2]) > UPRIGHT_AXIS:
        way = "counter-clockwise" if axis[2] > 0.0 else "clockwise"
        return f"seen from above, its limb turns {way}"
    motion = np.array(
        [
            axis[1] * lever[2] - axis[2] * lever[1],
            axis[2] * lever[0] - axis[0] * lever[2],
            axis[0] * lever[1] - axis[1] * lever[0],
        ]
    )
    largest = int(np.abs(motion).argmax())
    return f"the far end of its limb goes {WAYS[largest][int(motion[largest] > 0.0)]}"


def _find_axis(robot: Robot, joint: Joint) -> tuple[Array, Array]:
    """Return a joint's axis, (3,), and where its limb ends as seen from it [m], (3,)."""
    model = robot.spec().compile()
    data = mujoco.MjData(model)
    layout, standing = robot.layout(model), robot.standing
    data.qpos[layout.root_qpos : layout.root_qpos + 3] = standing.position
    data.qpos[layout.root_qpos + 3 : layout.root_qpos + 7] = standing.orientation
    data.qpos[layout.qpos] = standing.joint_pos
    mujoco.mj_kinematics(model, data)
    number = model.joint(joint.name).id
    anchor = data.xanchor[number]
    limb = _list_below(model, int(model.jnt_bodyid[number]))
    levers = [
        data.geom_xpos[geom] - anchor
        for geom in range(model.ngeom)
        if int(model.geom_bodyid[geom]) in limb
    ]
    lever = max(levers, key=lambda v: math.hypot(*v), default=np.array([0.0, 0.0, -1.0]))
    return data.xaxis[number].copy(), lever


def _list_below(model: mujoco.MjModel, body: int) -> set[int]:
    """Return a body and all that hang on it."""
    below = {body}
    for other in range(body + 1, model.nbody):  # parents come first
        if int(model.body_parentid[other]) in below:
            below.add(other)
    return below
