"""Populations: sampled genes that evolve towards lower costs."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

PARENTS = 5  # best of a generation, about which the next one is sampled


class Population(ABC):
    """Samples genes about a mean: `ask` for a generation, then `tell` its costs."""

    def __init__(
        self, mean: Array, spread: Array | float, size: int, rng: np.random.Generator
    ) -> None:
        """Begin about a mean, (...), with a standard deviation, (...), of each gene."""
        self.mean, self.spread = mean, spread
        self._rng = rng
        self._shape = (size, *mean.shape)
        self._genes = np.zeros(self._shape)

    def ask(self) -> Array:
        """Sample a generation, (size, ...)."""
        self._genes = self.mean + self.spread * self._rng.normal(size=self._shape)
        return self._genes

    def tell(self, cost: Array) -> NDArray[np.int_]:
        """Take the costs of the last generation, (size,); return its rows, the cheapest first."""
        order = np.argsort(cost, kind="stable")
        self._follow(self._genes[order[:PARENTS]])
        return order

    @abstractmethod
    def _follow(self, parents: Array) -> None:
        """Move to the parents, (PARENTS, ...), best first."""


class EvolutionStrategy(Population):
    """Samples about the weighted mean of the parents, with a constant standard deviation.

    (μ/μ_w, λ) of Hansen, "The CMA evolution strategy", 2016. The covariance is fixed, for searches
    that end within a few generations, before CMA-ES would have learned one.
    """

    def _follow(self, parents: Array) -> None:
        weight = np.log(PARENTS + 0.5) - np.log(np.arange(1, PARENTS + 1))
        self.mean = (weight / weight.sum()) @ parents


class CrossEntropy(Population):
    """The cross-entropy method: samples with mean and spread of the parents."""

    def __init__(
        self,
        mean: Array,
        spread: Array | float,
        size: int,
        rng: np.random.Generator,
        *,
        least_spread: float,
        bounds: tuple[Array, Array],
    ) -> None:
        """Begin as any population; genes are clipped to bounds."""
        super().__init__(mean, spread, size, rng)
        self._least, self._bounds = least_spread, bounds

    def ask(self) -> Array:
        """Sample a generation within the bounds, (size, ...)."""
        self._genes = np.clip(super().ask(), *self._bounds)
        return self._genes

    def _follow(self, parents: Array) -> None:
        self.mean = parents.mean(axis=0)
        self.spread = np.maximum(parents.std(axis=0), self._least)
