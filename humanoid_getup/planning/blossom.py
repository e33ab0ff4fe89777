"""Blossoms: steps straight to a target and around that direction."""

from __future__ import annotations

import math

import numpy as np

from robots.quaternion import Array

SPAN = math.radians(15.0)  # of a blossom, in each degree of freedom [Lin12], section 4.2.1


def blossom(origin: Array, way: Array, step: float, count: int, rng: np.random.Generator) -> Array:
    """Step along ``way`` (d,), then at up to ±15 degrees to it in each dimension, (count, d)."""
    length = float(np.linalg.norm(way))
    if length == 0.0:
        return np.tile(origin, (count, 1))
    direction = np.tile(way / length, (count, 1))
    direction[1:] += np.tan(rng.uniform(-SPAN, SPAN, size=(count - 1, len(way))))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return origin + min(step, length) * direction
