"""A population of keyframes that evolves by CMA-ES, with separate steps for angles and times."""

from __future__ import annotations

import numpy as np

from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.scoring import ANGLE_STEP, TIME_STEP
from robots import Robot
from robots.quaternion import Array


class KeyframePopulation:
    """Samples candidates about keyframes, and moves towards those that cost least."""

    def __init__(
        self, keyframes: Keyframes, robot: Robot, *, size: int, seed: int, step: float = 1.0
    ) -> None:
        """Begin at keyframes, with a first standard deviation in steps of times and angles."""
        self._keyframes, self._robot = keyframes, robot
        self._scale = np.full(len(keyframes.genes), ANGLE_STEP)
        self._scale[: len(keyframes.duration)] = TIME_STEP
        keep_matplotlib_out_of_home()  # cma imports it
        import cma

        options = {"popsize": size, "seed": seed + 1, "verbose": -9}
        self._evolution = cma.CMAEvolutionStrategy(keyframes.genes / self._scale, step, options)
        self._genes: list[Array] = []

    def ask(self) -> list[Keyframes]:
        """Sample the candidates of the next generation."""
        self._genes = self._evolution.ask()
        return [self._decode(genes) for genes in self._genes]

    def tell(self, cost: Array) -> None:
        """Take the costs of the candidates that were sampled last, (size,)."""
        self._evolution.tell(self._genes, cost.tolist())

    @property
    def mean(self) -> Keyframes:
        """Return the mean keyframes of the population."""
        return self._decode(self._evolution.mean)

    def _decode(self, genes: Array) -> Keyframes:
        return self._keyframes.with_genes(genes * self._scale, self._robot)
