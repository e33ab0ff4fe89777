"""Goal placement: places in a scene for postures of motions made on level ground."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from humanoid_getup.motions.posture_metric import align
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.body.parts import leg_length
from robots.kinematics import place
from robots.quaternion import Array

SUNK = 0.002  # m that a robot at rest sinks into what it lies on
HIGHEST = 0.25  # leg lengths by which what is under a posture may raise it
DISTANCES = (0.25, 0.5, 0.75, 1.0)  # leg lengths from the start to further places
DIRECTIONS = 8
UP = np.array([0.0, 0.0, 1.0])


class GoalPlacement:
    """Puts connecting postures on the ground or on obstacles, at the start or beside it."""

    def __init__(self, world: World) -> None:
        self._world, self._scene = world, world.scene
        self._clearance = Clearance(world)
        self._leg = leg_length(world.robot)

    def place(self, posture: Posture, start: Posture) -> Posture | None:
        """Put a posture at the place nearest to a start where it fits; ``None`` if there is none.

        It is turned to the start, tilted as the ground under it, and lowered until it rests.
        """
        if self._scene.is_flat:
            return align(posture, start)
        found = (self._put(posture, start, offset) for offset in self._offsets())
        return next((goal for goal in found if goal is not None), None)

    def _offsets(self) -> Iterator[Array]:
        yield np.zeros(2)
        angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        for distance in DISTANCES:
            yield from distance * self._leg * ring

    def _put(self, posture: Posture, start: Posture, offset: Array) -> Posture | None:
        """Put a posture beside a start by an offset (2,) [m]; ``None`` if it does not fit."""
        robot, model = self._world.robot, self._world.model
        goal = align(posture, start)
        at = np.array([*(start.position[:2] + offset), start.position[2]])
        under = float(self._scene.support(at))
        goal = replace(
            goal,
            position=np.array([*at[:2], under + posture.position[2]]),
            orientation=quaternion.multiply(self._tilt(at, under), goal.orientation),
        )
        rested = self._clearance.rest(place(robot, model, goal), -SUNK, under)
        layout = robot.layout(model)
        position = rested[layout.root_position].copy()
        if abs(position[2] - goal.position[2]) > HIGHEST * self._leg:
            return None
        return replace(goal, position=position)

    def _tilt(self, at: Array, under: float) -> Array:
        """Compute the rotation from level ground to that at a place (3,), (4,)."""
        x, y = at[:2]
        if under > float(self._scene.ground.height(x, y)) + SUNK:
            return np.array([1.0, 0.0, 0.0, 0.0])  # on an obstacle, whose top is taken as level
        normal = self._scene.ground.normal(x, y, 0.5 * self._leg)
        axis = np.cross(UP, normal)
        sine = float(np.linalg.norm(axis))
        if sine < 1e-9:
            return np.array([1.0, 0.0, 0.0, 0.0])
        return quaternion.from_axis_angle(axis / sine, float(np.arctan2(sine, normal[2])))
