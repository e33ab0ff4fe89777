"""Standing places: where in a scene a robot has room to stand."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import mujoco
import numpy as np
from scipy.spatial import KDTree

from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import leg_length, place
from robots.quaternion import Array

GRID = 0.25  # leg lengths between two places
REACH = 5.0  # leg lengths around the center, as far as places are looked for
HEADINGS = 4
ROOM = 0.5  # leg lengths around a place in which the robot fits as well, where there is such a one
ABOVE = 0.01  # m over its support at which a robot is checked


class StandingPlaces:
    """Looks for places around a point where a standing robot has room."""

    def __init__(self, world: World, center: Array) -> None:
        """Look around a point (3,) [m]: on the ground, and on what is under the point's height."""
        self._world, self._center = world, center
        self._data = mujoco.MjData(world.model)

    @property
    def exist(self) -> bool:
        """Return whether there is any."""
        return len(self._found) > 0

    def distance(self, point: Array) -> Array:
        """Compute the horizontal distances of points (..., 3) from the nearest place [m], (...)."""
        return self._tree.query(point[..., :2])[0]

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._found)

    @cached_property
    def _found(self) -> Array:
        """Return the places, (K, 2)."""
        leg = leg_length(self._world.robot)
        steps = np.arange(-REACH, REACH + GRID, GRID) * leg
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + self._center[:2]
        fits = np.array([self._fits(at) for at in grid])
        if fits.all() or not fits.any():
            return grid[fits]
        roomy = fits & (KDTree(grid[~fits]).query(grid)[0] > ROOM * leg)
        return grid[roomy if roomy.any() else fits]

    def _fits(self, at: Array) -> bool:
        scene = self._world.scene
        ground = float(scene.ground.height(at[0], at[1]))
        under = float(scene.support(np.array([*at, self._center[2]])))
        return any(self._fits_on(at, height) for height in {ground, under})

    def _fits_on(self, at: Array, height: float) -> bool:
        """Return whether a robot can stand there in any heading."""
        robot, model, data = self._world.robot, self._world.model, self._data
        raised = np.array([*at, height + robot.standing.position[2] + ABOVE])
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

    @cached_property
    def _is_obstacle(self) -> Array:
        flags = np.zeros(self._world.model.ngeom, dtype=bool)
        flags[[self._world.model.geom(o.name).id for o in self._world.scene.obstacles]] = True
        return flags


def check_standing_place(world: World, position: Array) -> None:
    """Check that a robot at a position (3,) [m] could stand anywhere near.

    Raises:
        ValueError: if it could not.
    """
    if world.scene.obstacles and not StandingPlaces(world, position).exist:
        reach = REACH * leg_length(world.robot)
        raise ValueError(
            f"scene '{world.scene.name}' has no place within {reach:.1f} m of the start where "
            f"'{world.robot.name}' could stand, expected room for it, its neck at a height of "
            f"{world.robot.standing_neck_height:.2f} m"
        )
