"""Coarse physics step: the longest in which no servo's own oscillation grows."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from humanoid_getup.simulation.world import World
from robots.kinematics import place

MOST_PHASE = 1.5  # rad, of a servo's oscillation within a physics step; it grows from 2 rad


def find_coarse_step(world: World) -> float:
    """Find the longest stable physics step that divides a robot's control period [s].

    A servo of stiffness k and the inertia I that it feels oscillate with sqrt(k / I). That of its
    joint in the standing posture is taken.
    """
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    felt = 1.0 / np.diag(np.linalg.inv(inertia))[robot.layout(model).dof]
    fastest = float(np.sqrt(robot.position_gain / felt).max())
    return robot.control_period / math.ceil(robot.control_period * fastest / MOST_PHASE)
