"""Evolution strategy: sampled genes that evolve towards lower costs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

PARENTS = 5  # best of a generation, about which the next one is sampled


class EvolutionStrategy:
    """Samples genes about the weighted mean of the parents: `ask`, then `tell` their costs.

    (μ/μ_w, λ) of Hansen, "The CMA evolution strategy", 2016. The covariance is fixed, for searches
    that end within a few generations, before CMA-ES would have learned one.
    """

    def __init__(self, mean: Array, spread: float, size: int, rng: np.random.Generator) -> None:
        """Begin about a mean, (...), with a standard deviation of all genes."""
        self.mean, self._spread, self._rng = mean, spread, rng
        self._shape = (size, *mean.shape)
        self._genes = np.zeros(self._shape)

    def ask(self) -> Array:
        """Sample a generation, (size, ...)."""
        self._genes = self.mean + self._spread * self._rng.normal(size=self._shape)
        return self._genes

    def tell(self, cost: Array) -> NDArray[np.int_]:
        """Take the costs of the last generation, (size,); return its rows, the cheapest first."""
        order = np.argsort(cost, kind="stable")
        parents = self._genes[order[:PARENTS]]
        weight = np.log(PARENTS + 0.5) - np.log(np.arange(1, PARENTS + 1))
        self.mean = (weight / weight.sum()) @ parents
        return order
