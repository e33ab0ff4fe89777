"""Distributions of what differs between robots; a number is always itself, and draws nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.quaternion import Array


@dataclass(frozen=True)
class Uniform:
    """Evenly between two bounds."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return rng.uniform(self.lower, self.upper, shape)


@dataclass(frozen=True)
class LogUniform:
    """Evenly between the logarithms of two bounds."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return np.exp(rng.uniform(np.log(self.lower), np.log(self.upper), shape))


@dataclass(frozen=True)
class Normal:
    """About zero."""

    deviation: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return rng.normal(0.0, self.deviation, shape)


@dataclass(frozen=True)
class RandomAxis:
    """Vectors of one length, in any direction."""

    length: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw vectors (..., 3)."""
        axis = rng.normal(size=shape)
        return self.length * axis / np.linalg.norm(axis, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Mixture:
    """One quantity with a probability, else another one."""

    probability: float
    one: Quantity
    other: Quantity

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        chosen = rng.random(shape) < self.probability
        return np.where(chosen, draw(self.one, rng, *shape), draw(self.other, rng, *shape))


Quantity = float | Uniform | LogUniform | Normal | RandomAxis | Mixture


def draw(quantity: Quantity, rng: np.random.Generator, *shape: int) -> Array:
    """Draw numbers of a shape; those of a constant quantity are it."""
    if isinstance(quantity, int | float):
        return np.full(shape, float(quantity))
    return quantity.draw(rng, *shape)
