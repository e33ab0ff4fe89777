"""Distributions of differences between robots; a constant draws no random number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.quaternion import Array


@dataclass(frozen=True)
class Uniform:
    """A uniform distribution between two bounds."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return rng.uniform(self.lower, self.upper, shape)


@dataclass(frozen=True)
class LogUniform:
    """A distribution that is uniform between the logarithms of two bounds."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return np.exp(rng.uniform(np.log(self.lower), np.log(self.upper), shape))


@dataclass(frozen=True)
class Normal:
    """A normal distribution about zero."""

    deviation: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return rng.normal(0.0, self.deviation, shape)


@dataclass(frozen=True)
class RandomAxis:
    """Vectors of one length in random directions."""

    length: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw vectors (..., 3)."""
        axis = rng.normal(size=shape)
        return self.length * axis / np.linalg.norm(axis, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Mixture:
    """One quantity with a given probability, else another one."""

    probability: float
    one: Quantity
    other: Quantity

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        chosen = rng.random(shape) < self.probability
        return np.where(chosen, draw(self.one, rng, *shape), draw(self.other, rng, *shape))


Quantity = float | Uniform | LogUniform | Normal | RandomAxis | Mixture


def draw(quantity: Quantity, rng: np.random.Generator, *shape: int) -> Array:
    """Draw numbers of a shape; a constant quantity is repeated."""
    if isinstance(quantity, int | float):
        return np.full(shape, float(quantity))
    return quantity.draw(rng, *shape)
