"""Search: varies targets until the motion stands in every disturbed world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.filtering.rehearsal import Rehearsal, Rehearsed, Worlds
from humanoid_getup.filtering.variation import Variation
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

SAMPLES = 10  # variations of a generation
HARDEST = 4  # worlds in which every variation is rehearsed
RIVALS = 2  # best variations of a generation that may be rehearsed in the other worlds
PARENTS = 5  # best variations of a generation, about whose mean the next one is sampled
STEP = 0.4  # standard deviation of a generation's genes
EFFORT_COST = 0.02  # of 1 N·m of RMS torque; a stand is worth 1 and what comes near it up to 1


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """What a search found."""

    target: Array
    """Best targets [rad], (T, n): those that it began with if it found no better ones."""
    share: float
    """Share of the worlds in which they end in a held stand; 0 if not in the nominal one."""
    generations: int
    rehearsals: int
    """How often a variation was rehearsed in a world."""
    simulated: float
    """Simulated time, all rehearsals together [s]."""


class TargetSearch:
    """An evolution strategy over variations, in the hardest worlds first.

    Each generation is sampled about the weighted mean of the best of the one before,
    (μ/μ_w, λ) of Hansen, "The CMA evolution strategy", 2016. Its covariance is fixed: a search
    ends within a few generations, before CMA-ES would have learned one.

    Disturbed worlds differ much in how hard they are, and most variations fail. So each is
    rehearsed in the nominal world and in those that are hardest for the best targets so far; only
    one that stands in all of them is rehearsed in the others, too.
    """

    def __init__(self, world: World, *, worlds: int, threads: int = 0) -> None:
        """Prepare for searches in up to that many worlds."""
        self.rehearsal = Rehearsal(world, max(SAMPLES * HARDEST, worlds), threads=threads)
        self._robot, self._layout = world.robot, world.robot.layout(world.model)

    def search(
        self, worlds: Worlds, target: Array, budget: float, rng: np.random.Generator
    ) -> SearchResult:
        """Vary targets [rad], (T, n), that stand in few worlds or in none.

        The search ends when they stand in all worlds, of which the first is the nominal one, or
        when the budget of simulated time [s] is spent.
        """
        start = worlds.starts[0, self._layout.qpos]
        outcome = self.rehearsal.play(worlds, [target])
        rehearsals, simulated, generations = len(worlds), outcome.simulated, 0
        best, share, hardest = target, _share(outcome), _find_hardest(outcome)
        mean = np.zeros(Variation.size(self._robot))
        while share < 1.0 and simulated < budget:
            generations += 1
            genes = mean + STEP * rng.normal(size=(SAMPLES, len(mean)))
            motions = [Variation.of(g).apply(target, start, self._robot) for g in genes]
            outcome = self.rehearsal.play(worlds.take(hardest), motions)
            rehearsals += outcome.stood.size
            simulated += outcome.simulated
            cost = _cost(outcome)
            order = np.argsort(cost, kind="stable")
            mean = _weights() @ genes[order[:PARENTS]]
            for i in order[:RIVALS]:
                if not outcome.stood[i].all():
                    break
                whole = self.rehearsal.play(worlds, [motions[i]])
                rehearsals += len(worlds)
                simulated += whole.simulated
                if _share(whole) > share:
                    best, share, hardest = motions[i], _share(whole), _find_hardest(whole)
                    break
        return SearchResult(
            target=best,
            share=share,
            generations=generations,
            rehearsals=rehearsals,
            simulated=simulated,
        )


def _cost(outcome: Rehearsed) -> Array:
    """Weigh motions by their stands, how near the others came to one, and effort, (S,)."""
    gain = outcome.stood + outcome.progress - EFFORT_COST * outcome.rms_torque  # (S, K)
    return -gain.mean(axis=1)


def _share(outcome: Rehearsed) -> float:
    """Return the share of the worlds in which a motion stands; 0 if not in the first."""
    return float(outcome.stood[0].mean()) if outcome.stood[0, 0] else 0.0


def _find_hardest(outcome: Rehearsed) -> NDArray[np.int_]:
    """Return the nominal world and those in which a motion does worst, (HARDEST,).

    Where it does not even stand in the nominal one, they are any.
    """
    others = np.arange(1, outcome.stood.shape[1])
    if outcome.stood[0, 0]:
        merit = (outcome.stood + outcome.progress)[0, others]
        others = others[np.argsort(merit, kind="stable")]
    return np.sort(np.concatenate([[0], others[: HARDEST - 1]]))


def _weights() -> Array:
    """Return the weights of the parents, best first, (PARENTS,)."""
    weight = np.log(PARENTS + 0.5) - np.log(np.arange(1, PARENTS + 1))
    return weight / weight.sum()
