"""Clearance: height of a posture over the ground and the obstacles of a scene."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.scenes.obstacle import Crossings
from humanoid_getup.simulation.world import World
from robots.body.overlap import measure_self_overlap
from robots.kinematics import lowest_point
from robots.quaternion import Array

STEP = 0.01  # m by which a robot is raised until it is free
PLACES = 9  # along each axis, at which the ground around a robot is looked up
FINE = 0.0005  # m to which the height is then known


class Clearance:
    """Measures and corrects the height of postures over the ground and obstacles."""

    def __init__(self, world: World) -> None:
        self._model, self._scene = world.model, world.scene
        self._data = mujoco.MjData(world.model)
        self._crossings = Crossings(world.model)
        reach = world.robot.standing_neck_height
        self._around = np.linspace(-reach, reach, PLACES)
        self._root = world.robot.layout(world.model).root_qpos
        self._is_world = world.is_world_geom

    def rest_where(self, qpos: Array, height: float = 0.0) -> Array:
        """Put a robot onto the ground or obstacle under its root, as `rest` does."""
        return self.rest(
            qpos, height, float(self._scene.support(qpos[self._root : self._root + 3]))
        )

    def measure_overlap(self, qpos: Array) -> float:
        """Measure how deep a robot penetrates the scene [m], at MuJoCo positions (nq,)."""
        self._collide(qpos)
        contact = self._data.contact
        chosen = self._is_world[contact.geom].any(axis=1)
        deepest = float(np.max(-contact.dist[chosen], initial=0.0))
        crossed = self._crossings.find(self._data)
        return max([deepest, *(self._crossings.depth(capsule) for capsule, _ in crossed)])

    def measure_self_overlap(self, qpos: Array) -> float:
        """Measure how deep a robot penetrates itself [m], at MuJoCo positions (nq,)."""
        self._collide(qpos)
        return measure_self_overlap(self._model, self._data)

    def measure_overlaps(self, qpos: Array) -> dict[str, float]:
        """Measure how deep a robot penetrates the ground and each obstacle that it touches [m]."""
        self._collide(qpos)
        deepest: dict[str, float] = {}
        for contact in self._data.contact[: self._data.ncon]:
            for geom in contact.geom[self._is_world[contact.geom]]:
                name = self._model.geom(geom).name
                deepest[name] = max(deepest.get(name, 0.0), -float(contact.dist))
        for capsule, box in self._crossings.find(self._data):
            name = self._model.geom(box).name
            deepest[name] = max(deepest.get(name, 0.0), self._crossings.depth(capsule))
        return deepest

    def _collide(self, qpos: Array) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)

    def rest(self, qpos: Array, height: float = 0.0, over: float | None = None) -> Array:
        """Put a robot above what is under it, as low as it is free, counted from the ground up.

        Args:
            qpos: MuJoCo positions, (nq,); the height of the root does not matter.
            height: How far above that it is put [m]; negative: how deep it presses in.
            over: Height of a surface under which the root is not put [m], even if there is room.
        """
        lowest = lowest_point(self._model, qpos)
        if self._scene.is_flat:
            return self._raise(qpos, height - lowest)
        allowed = max(-height, 0.0)
        at = self._raise(qpos, self._ground_around(qpos) - allowed - lowest)
        if over is not None:
            at = self._raise(at, max(over - at[self._root + 2], 0.0))
        while self.measure_overlap(at) > allowed:
            at = self._raise(at, STEP)
        low, high = -STEP, 0.0
        while high - low > FINE:
            middle = 0.5 * (low + high)
            is_free = self.measure_overlap(self._raise(at, middle)) <= allowed
            low, high = (low, middle) if is_free else (middle, high)
        return self._raise(at, high + max(height, 0.0))

    def _raise(self, qpos: Array, height: float) -> Array:
        raised = qpos.copy()
        raised[self._root + 2] += height
        return raised

    def _ground_around(self, qpos: Array) -> float:
        """Return the smallest height of the ground around a robot [m]."""
        x, y = np.meshgrid(*(qpos[self._root + i] + self._around for i in range(2)))
        return float(self._scene.ground.height(x, y).min())
