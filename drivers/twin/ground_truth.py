"""What only a simulation knows: for judges, film strips and tests, never for control."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from robots import Posture, Robot
from robots.quaternion import Array

WORLD = 0
"""Weld root of the world's own geometry."""

GroundHeight = Callable[[float, float], float]
"""Maps x, y [m] in the world to the height of the ground there [m]."""


@dataclass(frozen=True)
class Touch:
    """Two bodies that touch."""

    body: str
    other: str
    """``world`` where the body touches the ground or an obstacle."""
    depth: float
    """How far they are in each other [m]."""


def flat_ground(_x: float, _y: float) -> float:
    """Return the height of the plane z = 0."""
    return 0.0


class GroundTruth:
    """The true state of a twin, at the end of its last period."""

    def __init__(
        self, robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, ground: GroundHeight
    ) -> None:
        self.model, self.data = model, data
        self._ground = ground
        self._layout = robot.layout(model)
        self._neck = model.site(robot.neck_site).id
        self._soles = [model.site(site).id for site in robot.sole_sites]
        self._actuators = np.array([model.actuator(name).id for name in robot.joint_names])
        owner = model.geom_bodyid
        # Bodies welded to the world are scenery; soles' bodies are feet; others are foreign.
        self._is_world = model.body_weldid[owner] == WORLD
        feet = model.site_bodyid[self._soles]
        self._is_foot = np.isin(model.body_weldid[owner], model.body_weldid[feet])
        head = [model.joint(j.name).bodyid[0] for j in robot.joints if j.segment == "head"]
        self._head = head[-1] if head else -1
        self._is_head = owner == self._head

    @property
    def time(self) -> float:
        """Return the simulation's clock [s]."""
        return self.data.time

    @property
    def qpos(self) -> Array:
        """Return a copy of the whole configuration, to draw it later."""
        return self.data.qpos.copy()

    @property
    def posture(self) -> Posture:
        """Return where the root is, how it is turned, how the joints are bent."""
        root = self._layout.root_qpos
        return Posture(
            position=self.data.qpos[root : root + 3].copy(),
            orientation=self.data.qpos[root + 3 : root + 7].copy(),
            joint_pos=self.data.qpos[self._layout.qpos],
        )

    @property
    def root_velocity(self) -> Array:
        """Return the root's linear (world) and angular (root frame) velocity, (6,)."""
        root = self._layout.root_dof
        return self.data.qvel[root : root + 6].copy()

    @property
    def joint_vel(self) -> Array:
        """Return the joint speeds [rad/s], (n,)."""
        return self.data.qvel[self._layout.dof]

    @property
    def joint_torque(self) -> Array:
        """Return the torques that the servos made in the last physics step [N·m], (n,)."""
        return self.data.actuator_force[self._actuators]

    @property
    def tilt(self) -> float:
        """Return the angle between the torso's z axis and the vertical [rad]."""
        return math.acos(min(max(self.data.xmat[self._layout.torso, 8], -1.0), 1.0))

    @property
    def neck_height(self) -> float:
        """Return the height of the neck above the local ground under the feet [m]."""
        x, y, _ = self.data.site_xpos[self._soles].mean(axis=0)
        return float(self.data.site_xpos[self._neck, 2]) - self._ground(float(x), float(y))

    @property
    def foreign_contact(self) -> bool:
        """Tell whether anything but the feet touches the world."""
        first, second, _ = self._contacts()
        foreign = ~(self._is_world | self._is_foot)
        touches = foreign[first] & self._is_world[second] | self._is_world[first] & foreign[second]
        return bool(touches.any())

    @property
    def head_contact(self) -> bool:
        """Tell whether the head touches the world."""
        first, second, _ = self._contacts()
        world, head = self._is_world, self._is_head
        return bool((head[first] & world[second] | world[first] & head[second]).any())

    @property
    def head_speed(self) -> float:
        """Return how fast the head moves [m/s]; 0 for a robot without one."""
        if self._head < 0:
            return 0.0
        velocity = np.zeros(6)
        kind = mujoco.mjtObj.mjOBJ_BODY
        mujoco.mj_objectVelocity(self.model, self.data, kind, self._head, velocity, 0)
        return float(np.linalg.norm(velocity[3:]))

    @property
    def feet_contact(self) -> bool:
        """Tell whether a foot touches the world."""
        first, second, _ = self._contacts()
        world, foot = self._is_world, self._is_foot
        return bool((foot[first] & world[second] | world[first] & foot[second]).any())

    @property
    def ground_penetration(self) -> float:
        """Return how deep the robot is in the world, at most [m]."""
        first, second, depth = self._contacts()
        return float(depth[self._is_world[first] != self._is_world[second]].max(initial=0.0))

    @property
    def self_penetration(self) -> float:
        """Return how deep the robot is in itself, at most [m]."""
        first, second, depth = self._contacts()
        return float(depth[~self._is_world[first] & ~self._is_world[second]].max(initial=0.0))

    def list_world_contacts(self) -> list[Touch]:
        """List what of the robot touches the world, one entry a contact point."""
        return [touch for touch in self._touches() if touch.other == "world"]

    def list_self_contacts(self) -> list[Touch]:
        """List where the robot touches itself, one entry a contact point."""
        return [touch for touch in self._touches() if touch.other != "world"]

    def _contacts(self) -> tuple[np.ndarray, np.ndarray, Array]:
        """Return the touching geoms and depths, each (contacts,)."""
        contact = self.data.contact
        distance = contact.dist
        touching = distance <= 0.0
        geom = contact.geom[touching]  # (contacts, 2)
        return geom[:, 0], geom[:, 1], -distance[touching]

    def _touches(self) -> list[Touch]:
        touches = []
        for first, second, depth in zip(*self._contacts(), strict=True):
            if self._is_world[first]:
                first, second = second, first
            other = "world" if self._is_world[second] else self._body_name(second)
            touches.append(Touch(self._body_name(first), other, float(depth)))
        return touches

    def _body_name(self, geom: int) -> str:
        return self.model.body(self.model.geom_bodyid[geom]).name
