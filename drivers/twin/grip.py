"""The hands of a person who holds a simulated robot."""

from __future__ import annotations

import mujoco
import numpy as np

from robots import Robot
from robots.quaternion import Array

HELD_INERTIA = 1e8
"""Inertia of what is held [kg, kg·m²]: neither gravity nor a servo moves it noticeably."""
HELD_DAMPING = 1e8
"""Its damping [N·s/m, N·m·s]: it does not creep."""


class Grip:
    """Holds the torso of a robot and each of its joints whose servo has no torque."""

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        """Grip a robot in its compiled world; the model's inertia and damping are changed."""
        self._model, self._joint_dofs = model, robot.layout(model).dof
        torso = model.body(robot.torso).id
        self._own = model.dof_treeid == model.body_treeid[torso]
        self._armature, self._damping = model.dof_armature.copy(), model.dof_damping.copy()

    def hold(self, data: mujoco.MjData, torque: Array) -> None:
        """Hold all but the joints with torque [N·m], (n,), and bring what is held to rest."""
        held = self._own.copy()
        held[self._joint_dofs] = torque <= 0.0
        self._model.dof_armature[:] = np.where(held, HELD_INERTIA, self._armature)
        self._model.dof_damping[:] = np.where(held, HELD_DAMPING, self._damping)
        data.qvel[held] = 0.0
        mujoco.mj_step1(self._model, data)  # which takes the inertia up

    def let_go(self) -> None:
        """Let everything go; the model is as before."""
        self._model.dof_armature[:] = self._armature
        self._model.dof_damping[:] = self._damping
