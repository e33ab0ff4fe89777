"""The space of the root's position (3,), in which a path is searched first."""

from __future__ import annotations

import numpy as np

from humanoid_getup.planning.blossom import blossom
from humanoid_getup.scenes.scene import Scene
from robots.quaternion import Array

STEP = 0.05  # m


class PositionSpace:
    """Positions around a start and a goal."""

    def __init__(self, start: Array, goal: Array, margin: Array | float) -> None:
        """Reach beyond start and goal by a margin [m], in all directions or in each, (3,)."""
        self.low, self.high = np.minimum(start, goal) - margin, np.maximum(start, goal) + margin

    def distance(self, nodes: Array, x: Array) -> Array:
        """Compute Euclidean distances."""
        return np.linalg.norm(nodes - x, axis=1)

    def sample(self, rng: np.random.Generator) -> Array:
        """Draw a position around the start and the goal."""
        return rng.uniform(self.low, self.high)

    def steer(
        self, near: Array, target: Array, _goal: Array, count: int, rng: np.random.Generator, /
    ) -> Array:
        """Step straight to the target, and around that direction."""
        return blossom(near, target - near, STEP, count, rng)

    def is_within_step(self, a: Array, b: Array) -> bool:
        """Return whether two positions are within a step."""
        return bool(np.linalg.norm(a - b) <= STEP)


class PointProblem(PositionSpace):
    """Search for a path of the root alone, as a point: over the ground, outside the obstacles."""

    def __init__(self, scene: Scene, start: Array, goal: Array) -> None:
        super().__init__(start, goal, float(np.linalg.norm(goal - start)) + STEP)
        self.scene = scene

    def fails(self, _a: Array, b: Array, /) -> bool:
        """Return whether the root would be in the ground or in an obstacle."""
        is_under = b[2] < self.scene.ground.height(b[0], b[1])
        return bool(is_under) or any(o.contains(b) for o in self.scene.obstacles)
