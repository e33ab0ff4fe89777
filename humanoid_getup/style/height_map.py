"""The height map: the ground around a robot, for policies that observe it."""

from __future__ import annotations

import numpy as np

from humanoid_getup.scenes.ground import Ground
from humanoid_getup.style.features import AROUND, level
from robots import Robot, quaternion
from robots.quaternion import Array

GRID = 5
"""Points on each side of the height map, whose rows run forward and columns to the left."""
PLACES = np.linspace(-1.0, 1.0, GRID)
FORWARD, LEFT = (grid.ravel() for grid in np.meshgrid(PLACES, PLACES, indexing="ij"))
UNKNOWN = np.zeros(GRID**2)
"""Height map of a robot without knowledge of the ground: level."""


def measure_height_map(robot: Robot, ground: Ground, position: Array, orientation: Array) -> Array:
    """Measure the heights of the ground around robots, (N, 25), as shares of standing.

    They are those of 5 by 5 points, over their mean: rows forward, columns to the left of where
    the torso is turned. Positions of the torso are (N, 3) [m], orientations (N, 4).
    """
    if ground.is_level:
        return np.tile(UNKNOWN, (len(position), 1))
    upright = level(quaternion.gravity_in_body(orientation))
    heading = quaternion.multiply(orientation, quaternion.inverse(upright))
    ahead = quaternion.rotate(heading, np.array([1.0, 0.0, 0.0]))[:, :2]
    size = robot.standing_neck_height
    cos, sin = AROUND * size * ahead.T[..., np.newaxis]
    x = position[:, :1] + cos * FORWARD - sin * LEFT
    y = position[:, 1:2] + sin * FORWARD + cos * LEFT
    heights = ground.height(x, y) / size
    return heights - heights.mean(axis=1, keepdims=True)
