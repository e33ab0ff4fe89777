"""Ground truth of a simulation, for judges and tests and never for control."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots import Posture, Robot
from robots.body.overlap import measure_self_overlap
from robots.quaternion import Array

WORLD = 0
"""Weld root of the world's own geometry."""
ROUNDING = 1e-9


class GroundTruth:
    """The true state of a simulation at the end of its last period."""

    def __init__(self, robot: Robot, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model, self.data = model, data
        self._layout = robot.layout(model)
        self._actuators = np.array([model.actuator(name).id for name in robot.joint_names])
        # Bodies that are welded to the world are scenery.
        self._is_world = model.body_weldid[model.geom_bodyid] == WORLD

    @property
    def qpos(self) -> Array:
        """Return a copy of the MuJoCo positions, (nq,)."""
        return self.data.qpos.copy()

    @property
    def site_pos(self) -> Array:
        """Return a copy of the positions of all sites in the world [m], (nsite, 3)."""
        return self.data.site_xpos.copy()

    @property
    def site_mat(self) -> Array:
        """Return a copy of the axes of all sites in the world, (nsite, 9)."""
        return self.data.site_xmat.copy()

    @property
    def posture(self) -> Posture:
        """Return root position, root orientation and joint angles."""
        qpos, layout = self.data.qpos, self._layout
        return Posture(
            position=qpos[layout.root_position].copy(),
            orientation=qpos[layout.root_orientation].copy(),
            joint_pos=qpos[layout.qpos],
        )

    def is_erect(self, tilt: float) -> bool:
        """Return whether the torso is tilted by no more than an angle [rad], in microseconds."""
        _, x, y, _ = self.data.qpos[self._layout.root_orientation].tolist()
        return 1.0 - 2.0 * (x * x + y * y) >= math.cos(tilt) - ROUNDING

    @property
    def joint_vel(self) -> Array:
        """Return the joint speeds [rad/s], (n,)."""
        return self.data.qvel[self._layout.dof]

    @property
    def joint_torque(self) -> Array:
        """Return the actuators' torques of the last physics step [N·m], (n,)."""
        return self.data.actuator_force[self._actuators]

    @property
    def touching_bodies(self) -> NDArray[np.integer]:
        """Return the robot's bodies that touch the world, one entry per contact point."""
        first, second, _ = self._contacts()
        world = self._is_world
        geoms = np.concatenate([first[world[second]], second[world[first]]])
        return self.model.geom_bodyid[geoms[~world[geoms]]]

    @property
    def ground_penetration(self) -> float:
        """Return the greatest depth of the robot in the world [m]."""
        first, second, depth = self._contacts()
        return float(depth[self._is_world[first] != self._is_world[second]].max(initial=0.0))

    @property
    def self_penetration(self) -> float:
        """Return the greatest depth of the robot in itself [m]."""
        return measure_self_overlap(self.model, self.data)

    def measure_speed(self, body: int) -> float:
        """Measure the speed of a body's frame [m/s]."""
        return self._measure_speed(mujoco.mjtObj.mjOBJ_BODY, body)

    def measure_site_speed(self, site: int) -> float:
        """Measure the speed of a site [m/s]."""
        return self._measure_speed(mujoco.mjtObj.mjOBJ_SITE, site)

    def _measure_speed(self, kind: mujoco.mjtObj, number: int) -> float:
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, kind, number, velocity, 0)
        return float(np.linalg.norm(velocity[3:]))

    def _contacts(self) -> tuple[np.ndarray, np.ndarray, Array]:
        """Return the touching geoms and depths, each (contacts,)."""
        contact = self.data.contact
        distance = contact.dist
        touching = distance <= 0.0
        geom = contact.geom[touching]  # (contacts, 2)
        return geom[:, 0], geom[:, 1], -distance[touching]
