"""First success: keyframes that fail everywhere are changed until they succeed once, undisturbed.

A search that wants robust motions learns nothing from candidates that all fail. This one is cheap:
one rollout a candidate, at full torque in the nominal world, and it ends with the first success.
"""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.motions.keyframe_population import KeyframePopulation
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.scoring import (
    SEARCH_HOLD,
    SEARCH_TIMESTEP,
    SWAY_TIME,
    score,
)
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

POPULATION = 24
FIRST_STEP = 1.5  # of the first step sizes of the search for robust motions


class FirstSuccess:
    """Searches from keyframes for some that end as they should, once."""

    def __init__(self, world: World, start: Array) -> None:
        """Prepare to search from MuJoCo positions (nq,)."""
        self._start = start
        self._world = World(world.robot, world.scene, model=copy.copy(world.model))
        self._world.model.opt.timestep = world.robot.choose_timestep(SEARCH_TIMESTEP)
        self._experiment = Experiment(self._world)

    def succeeds(self, keyframes: Keyframes) -> bool:
        """Return whether keyframes succeed as they are."""
        return bool(self._play([keyframes])[1][0])

    def find(
        self,
        keyframes: Keyframes,
        generations: int,
        seed: int,
        report: Callable[[int, float, float], None] = lambda *_: None,
    ) -> Keyframes | None:
        """Find keyframes that succeed; None if there are none within so many generations.

        After each generation its number, best cost and share of successes are reported.
        """
        robot = self._world.robot
        population = KeyframePopulation(
            keyframes, robot, size=POPULATION, seed=seed, step=FIRST_STEP
        )
        for generation in range(generations):
            candidates = population.sample()
            cost, succeeded = self._play(candidates)
            report(generation, float(cost.min()), float(succeeded.mean()))
            if succeeded.any():
                return candidates[int(np.argmin(np.where(succeeded, cost, np.inf)))]
            population.learn(cost)
        return None

    def _play(self, candidates: list[Keyframes]) -> tuple[Array, np.ndarray]:
        """Roll candidates out once; return their costs and whether they succeeded, (C,)."""
        plays = [c.targets(self._world.robot, SEARCH_HOLD + SWAY_TIME) for c in candidates]
        start = Scenarios.nominal(self._world, self._start)
        record = self._experiment.play(start.tile(len(candidates)), plays)
        durations = np.array([c.duration.sum() for c in candidates])
        return score(record, self._world, candidates[0], SEARCH_HOLD, None, durations)
