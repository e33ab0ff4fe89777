"""A search problem in the plane, without obstacles."""

import numpy as np

from robots.quaternion import Array

STEP = 0.15


class OpenPlane:
    """Points within 2 of the origin; steps lead to the target and, as [Kalisiak06], all around."""

    def distance(self, nodes: Array, x: Array) -> Array:
        return np.linalg.norm(nodes - x, axis=1)

    def sample(self, rng: np.random.Generator) -> Array:
        return rng.uniform(-2.0, 2.0, size=2)

    def steer(self, near, target, goal, count, rng) -> Array:  # noqa: ARG002
        way = target - near
        heading = np.arctan2(way[1], way[0]) + 2.0 * np.pi * np.arange(count) / count
        step = min(STEP, float(np.linalg.norm(way)))
        return near + step * np.stack([np.cos(heading), np.sin(heading)], axis=1)

    def is_within_step(self, a: Array, b: Array) -> bool:
        return bool(np.linalg.norm(a - b) <= STEP + 1e-9)
