"""Search: varies targets until the motion stands in every disturbed world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.filtering.rehearsal import Rehearsal, Rehearsed, Worlds
from humanoid_getup.filtering.variation import Variation
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

SAMPLES = 10  # variations of a generation
HARDEST = 3  # worlds in which every variation is rehearsed
RIVALS = 2  # best variations of a generation that may be rehearsed in the other worlds
FIRST_SIZE, SMALLEST_SIZE, LARGEST_SIZE = 0.5, 0.15, 1.0  # of a step
GROWTH, SHRINKAGE = 1.3, 0.85  # of the step after a generation with and without success
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Incumbent:
    """The best variation so far."""

    variation: Variation
    target: Array
    """[rad], (T, n)"""
    share: float
    """As of a result."""
    hardest: NDArray[np.int_]
    """The nominal world and those in which it does worst, (HARDEST,)."""
    score: float
    """Its score in those."""


class TargetSearch:
    """A random search that races: (1+λ), with a step that adapts to its success.

    Disturbed worlds differ much in how hard they are, and most variations fail. So each is
    rehearsed in the nominal world and in those that are hardest for the best variation so far;
    only the few that do better there are rehearsed in the others, too.
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
        log = _Log(self.rehearsal)
        best = _weigh(Variation.none(self._robot), target, log.play(worlds, [target]))
        size, generations = FIRST_SIZE, 0
        while best.share < 1.0 and log.simulated < budget:
            generations += 1
            better = self._try_generation(worlds, target, best, size, log, rng)
            size *= SHRINKAGE if better is None else GROWTH
            size = min(max(size, SMALLEST_SIZE), LARGEST_SIZE)
            best = best if better is None else better
        return SearchResult(
            target=best.target,
            share=best.share,
            generations=generations,
            rehearsals=log.rehearsals,
            simulated=log.simulated,
        )

    def _try_generation(
        self,
        worlds: Worlds,
        origin: Array,
        best: _Incumbent,
        size: float,
        log: _Log,
        rng: np.random.Generator,
    ) -> _Incumbent | None:
        """Sample variations of the original targets (T, n) near the best one.

        Returns one that is better, or ``None``.
        """
        start = worlds.starts[0, self._layout.qpos]
        variations = [best.variation.perturb(size, rng) for _ in range(SAMPLES)]
        motions = [v.apply(origin, start, self._robot) for v in variations]
        outcome = log.play(worlds.take(best.hardest), motions)
        score = _score(outcome)
        for i in np.argsort(-score, kind="stable")[:RIVALS]:
            if score[i] <= best.score:
                break
            if best.share == 0.0 and not outcome.stood[i].all():
                # It does not stand yet: to come nearer in the hardest worlds is enough.
                return replace(best, variation=variations[i], target=motions[i], score=score[i])
            rival = _weigh(variations[i], motions[i], log.play(worlds, [motions[i]]))
            if rival.share > best.share:
                return rival
        return None


class _Log:
    """Rehearses, and counts what that costs."""

    def __init__(self, rehearsal: Rehearsal) -> None:
        self._rehearsal = rehearsal
        self.rehearsals, self.simulated = 0, 0.0

    def play(self, worlds: Worlds, motions: list[Array]) -> Rehearsed:
        outcome = self._rehearsal.play(worlds, motions)
        self.rehearsals += len(motions) * len(worlds)
        self.simulated += outcome.simulated
        return outcome


def _score(outcome: Rehearsed) -> Array:
    """Score motions by their stands, and by how near the others came to one, (S,)."""
    gain = outcome.stood + outcome.progress - EFFORT_COST * outcome.rms_torque  # (S, K)
    return gain.mean(axis=1)


def _weigh(variation: Variation, target: Array, outcome: Rehearsed) -> _Incumbent:
    """Weigh a variation by its rehearsal in all worlds."""
    merit = (outcome.stood + outcome.progress)[0]  # (K,)
    others = 1 + np.argsort(merit[1:], kind="stable")
    hardest = np.concatenate([[0], np.sort(others[: HARDEST - 1])])
    return _Incumbent(
        variation=variation,
        target=target,
        share=float(outcome.stood.mean()) if outcome.stood[0, 0] else 0.0,
        hardest=hardest,
        score=float(_score(outcome.take(hardest))[0]),
    )
