"""Placement: place and heading of a robot in a scene, and places with room to stand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
import scipy  # which imports its parts when they are used
from numpy.typing import NDArray

from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.body.parts import leg_length
from robots.kinematics import place
from robots.quaternion import Array

UPRIGHT = 0.7  # length of the spine's horizontal part from which it gives the heading


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Place and heading of a robot in its scene."""

    x: float
    """Position of the torso [m]."""
    y: float
    heading: float
    """Horizontal direction in which the head of a lying robot points, or the front of an upright
    one [rad]; 0 is along +x."""

    @staticmethod
    def of(posture: Posture) -> Placement:
        """Return the placement of a posture."""
        x, y = posture.position[:2].tolist()
        return Placement(x=x, y=y, heading=measure_heading(posture.orientation))

    def turn(self, orientation: Array) -> Array:
        """Turn an orientation (4,) of unknown heading about the vertical to this heading."""
        turn = quaternion.from_yaw(self.heading - measure_heading(orientation))
        return quaternion.normalize(quaternion.multiply(turn, orientation))


def measure_heading(orientation: Array) -> float:
    """Measure the heading of a torso [rad], by its spine or, if that is upright, by its front."""
    spine = quaternion.rotate(orientation, np.array([0.0, 0.0, 1.0]))
    front = quaternion.rotate(orientation, np.array([1.0, 0.0, 0.0]))
    axis = spine if math.hypot(spine[0], spine[1]) > UPRIGHT else front
    return math.atan2(axis[1], axis[0])


GRID = 0.25  # leg lengths between two places
REACH = 5.0  # leg lengths around the center, as far as places are looked for
HEADINGS = 4
ROOM = 0.5  # leg lengths around a place in which the robot fits as well, where there is such a one
ABOVE = 0.01  # m over its support at which a robot is checked


class StandingPlaces:
    """Finds places around a point with room for a standing robot."""

    def __init__(self, world: World, center: Array) -> None:
        """Search around a point (3,) [m]: on the ground, and on obstacles below its height."""
        self._world, self._center = world, center
        self._data = mujoco.MjData(world.model)
        mujoco.mj_kinematics(world.model, self._data)

    @property
    def exist(self) -> bool:
        """Return whether there is any."""
        return len(self._found) > 0

    def distance(self, point: Array) -> Array:
        """Compute the horizontal distances of points (..., 3) from the nearest place [m], (...)."""
        return self._tree.query(point[..., :2])[0]

    def distance_to_any(self, point: Array) -> float:
        """Compute the distance of a point (3,) from where the robot just fits [m]."""
        grid, fits = self._grid
        return float(np.linalg.norm(grid[fits] - point[:2], axis=1).min())

    def find_nearest(self, point: Array, count: int) -> Array:
        """Find the nearest places to a point (3,), ``count`` at most, (K, 2), nearest first."""
        apart = np.linalg.norm(self._found - point[:2], axis=1)
        return self._found[np.argsort(apart, kind="stable")[:count]]

    @cached_property
    def _tree(self) -> scipy.spatial.KDTree:
        return scipy.spatial.KDTree(self._found)

    @cached_property
    def _found(self) -> Array:
        """Return the places, (K, 2), if possible those with some room around them."""
        grid, fits = self._grid
        if fits.all() or not fits.any():
            return grid[fits]
        roomy = scipy.spatial.KDTree(grid[~fits]).query(grid)[0] > ROOM * leg_length(
            self._world.robot
        )
        return grid[fits & roomy if (fits & roomy).any() else fits]

    @cached_property
    def _grid(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return points of a grid, (K, 2), and whether a standing robot fits there, (K,)."""
        leg = leg_length(self._world.robot)
        steps = np.arange(-REACH, REACH + GRID, GRID) * leg
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + self._center[:2]
        scene, height = self._world.scene, np.full(len(grid), self._center[2])
        ground = scene.ground.height(grid[:, 0], grid[:, 1])
        under = scene.support(np.column_stack([grid, height]))
        levels = zip(ground.tolist(), under.tolist(), strict=True)
        fits = np.array([self._fits(*one) for one in zip(grid, levels, strict=True)])
        return grid, fits

    def _fits(self, at: Array, levels: tuple[float, float]) -> bool:
        return any(self._fits_on(at, height) for height in set(levels))

    def _fits_on(self, at: Array, height: float) -> bool:
        """Return whether a robot can stand there in any heading."""
        robot, model, data = self._world.robot, self._world.model, self._data
        raised = np.array([*at, height + robot.standing.position[2] + ABOVE])
        if self._is_far(raised):
            return True
        for heading in np.arange(HEADINGS) * (np.pi / HEADINGS):
            turned = quaternion.multiply(quaternion.from_yaw(heading), robot.standing.orientation)
            posture = replace(robot.standing, position=raised, orientation=turned)
            data.qpos[:] = place(robot, model, posture)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_collision(model, data)
            if np.any(self._is_obstacle[data.contact.geom]):
                return False
        return True

    def _is_far(self, root: Array) -> bool:
        """Return whether every obstacle is out of reach of a robot that stands at a root (3,)."""
        model = self._world.model
        apart = np.einsum("kij,ki->kj", self._frames, root - self._data.geom_xpos[self._obstacles])
        apart -= model.geom_aabb[self._obstacles, :3]
        outside = np.maximum(np.abs(apart) - model.geom_aabb[self._obstacles, 3:], 0.0)
        return bool(np.all(np.linalg.norm(outside, axis=1) > self._reach))

    @cached_property
    def _reach(self) -> float:
        """Return the radius of a sphere about the root of a standing robot [m]."""
        robot, model, data = self._world.robot, self._world.model, self._data
        data.qpos[:] = place(robot, model, robot.standing)
        mujoco.mj_kinematics(model, data)
        own = np.flatnonzero(~self._world.is_world_geom)
        apart = np.linalg.norm(data.geom_xpos[own] - robot.standing.position, axis=1)
        return float((apart + model.geom_rbound[own]).max())

    @cached_property
    def _obstacles(self) -> NDArray[np.intp]:
        model = self._world.model
        return np.array([model.geom(o.name).id for o in self._world.scene.obstacles], int)

    @cached_property
    def _frames(self) -> Array:
        """Return the axes of the obstacles' bounding boxes, (K, 3, 3)."""
        return self._data.geom_xmat[self._obstacles].reshape(-1, 3, 3)

    @cached_property
    def _is_obstacle(self) -> Array:
        flags = np.zeros(self._world.model.ngeom, dtype=bool)
        flags[self._obstacles] = True
        return flags


def check_standing_place(world: World, position: Array) -> None:
    """Check that there is a place to stand near a position (3,) [m]."""
    if world.scene.obstacles and not StandingPlaces(world, position).exist:
        reach = REACH * leg_length(world.robot)
        raise ValueError(
            f"scene '{world.scene.name}' has no place within {reach:.1f} m of the start where "
            f"'{world.robot.name}' could stand, expected room for it, its neck at a height of "
            f"{world.robot.standing_neck_height:.2f} m"
        )
