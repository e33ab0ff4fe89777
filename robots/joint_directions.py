"""Directions of joints: which way a limb moves as the angle of its joint grows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.kinematics import place
from robots.quaternion import Array
from robots.robot import Robot

VERTICAL_AXIS = 0.8  # vertical share of a joint axis above which its motion is called a turn
DIRECTIONS = (("backward", "forward"), ("to its right", "to its left"), ("down", "up"))
"""Negative and positive of the robot's x, y and z when it stands."""


@dataclass(frozen=True, kw_only=True)
class JointDirection:
    """Which way a limb moves as the angle of its joint grows, for a standing robot."""

    way: str
    """Way of the far end of the limb, or of a turn about the vertical seen from above."""
    is_turn: bool

    def __str__(self) -> str:
        """Describe the motion of the limb."""
        if self.is_turn:
            return f"seen from above, its limb turns {self.way}"
        return f"the far end of its limb goes {self.way}"


def find_directions(robot: Robot) -> dict[str, JointDirection]:
    """Find the direction of every joint, by its name."""
    spec = robot.spec()
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    found = {}
    for name in robot.joint_names:
        number = model.joint(name).id
        limb = [geom.id for geom in spec.joint(name).parent.find_all("geom")]
        levers = data.geom_xpos[limb] - data.xanchor[number]
        lever = max(levers, key=lambda v: math.hypot(*v), default=np.array([0.0, 0.0, -1.0]))
        found[name] = _name_direction(data.xaxis[number], lever)
    return found


def _name_direction(axis: Array, lever: Array) -> JointDirection:
    """Name the motion of a limb's far end, at ``lever`` from its joint, x forward and y left."""
    if abs(axis[2]) > VERTICAL_AXIS:
        way = "counter-clockwise" if axis[2] > 0.0 else "clockwise"
        return JointDirection(way=way, is_turn=True)
    motion = np.cross(axis, lever)
    largest = int(np.abs(motion).argmax())
    return JointDirection(way=DIRECTIONS[largest][int(motion[largest] > 0.0)], is_turn=False)
