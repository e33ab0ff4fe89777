"""Search: varies targets until a motion stands in every disturbed world, or costs less."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.filtering.variation import Variation
from humanoid_getup.motions.preference import Preference
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

SAMPLES = 10  # variations of a generation
HARDEST = 4  # worlds in which every variation is rolled out
RIVALS = 2  # best variations of a generation that may be rolled out in the other worlds
PARENTS = 5  # best variations of a generation, about whose mean the next one is sampled
STEP = 0.4  # standard deviation of a generation's genes
EFFORT = 0.02  # of 1 s of a preference's cost; a stand is worth 1, what comes near it up to 1
NO_STAND = 10.0  # s, cost of a rise that fails, beside the stand that it misses
FINE_STEP = 0.25  # standard deviation of the genes of a motion that stands
FINALISTS = 3  # cheapest variations that an improvement returns


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """Variations of a motion that cost less and stand in the worlds in which they were tried."""

    targets: list[Array]
    """Their targets [rad], each (T, n), the cheapest first; none if no cheaper one was found."""
    rollouts: int
    """How often a variation was rolled out in a world."""
    simulated: float
    """Simulated time, all rollouts together [s]."""


@dataclass(frozen=True, kw_only=True)
class FoundTargets:
    """What a search found."""

    target: Array
    """Best targets [rad], (T, n): those that it began with if it found no better ones."""
    share: float
    """Share of the worlds in which they end in a held stand; 0 if not in the nominal one."""
    generations: int
    rollouts: int
    """How often a variation was rolled out in a world."""
    simulated: float
    """Simulated time, all rollouts together [s]."""


class TargetSearch:
    """An evolution strategy over variations, in the hardest worlds first.

    Each generation is sampled about the weighted mean of the best of the one before,
    (μ/μ_w, λ) of Hansen, "The CMA evolution strategy", 2016. Its covariance is fixed: a search
    ends within a few generations, before CMA-ES would have learned one.

    Disturbed worlds differ much in how hard they are, and most variations fail. So each is
    rolled out in the nominal world and in those that are hardest for the best targets so far; only
    one that stands in all of them is rolled out in the others, too.
    """

    def __init__(self, world: World, *, preference: Preference, threads: int = 0) -> None:
        """Prepare for searches in a world."""
        self.preference = preference
        self.experiment = Experiment(world, threads=threads)
        self._robot, self._layout = world.robot, world.robot.layout(world.model)

    def search(
        self, scenarios: Scenarios, target: Array, budget: float, rng: np.random.Generator
    ) -> FoundTargets:
        """Vary targets [rad], (T, n), that stand in few worlds or in none.

        The search ends when they stand in all worlds, of which the first is the nominal one, or
        when the budget of simulated time [s] is spent.
        """
        start = scenarios.starts[0, self._layout.qpos]
        outcome = self.experiment.compare(scenarios, [target])
        rollouts, simulated, generations = len(scenarios), outcome.record.duration, 0
        best, share, hardest = target, _share(outcome), _find_hardest(outcome)
        mean = np.zeros(Variation.size(self._robot))
        while share < 1.0 and simulated < budget:
            generations += 1
            genes = mean + STEP * rng.normal(size=(SAMPLES, len(mean)))
            motions = [Variation.of(g).apply(target, start, self._robot) for g in genes]
            outcome = self.experiment.compare(scenarios.take(hardest), motions)
            rollouts += outcome.stood.size
            simulated += outcome.record.duration
            cost = self._weigh(outcome)
            order = np.argsort(cost, kind="stable")
            mean = _weights() @ genes[order[:PARENTS]]
            for i in order[:RIVALS]:
                if not outcome.stood[i].all():
                    break
                whole = self.experiment.compare(scenarios, [motions[i]])
                rollouts += len(scenarios)
                simulated += whole.record.duration
                if _share(whole) > share:
                    best, share, hardest = motions[i], _share(whole), _find_hardest(whole)
                    break
        return FoundTargets(
            target=best,
            share=share,
            generations=generations,
            rollouts=rollouts,
            simulated=simulated,
        )

    def improve(
        self, scenarios: Scenarios, target: Array, budget: float, rng: np.random.Generator
    ) -> Improvement:
        """Vary targets [rad], (T, n), that stand in few worlds, so that they cost less there.

        The budget is simulated time [s]. The search ends before it is spent when no cheaper one
        is wanted.
        """
        start = scenarios.starts[0, self._layout.qpos]
        outcome = self.experiment.compare(scenarios, [target])
        rollouts, simulated = len(scenarios), outcome.record.duration
        mean = np.zeros(Variation.size(self._robot))
        begun = float(self._weigh(outcome)[0])
        best = [(begun, target)]
        content = self._is_content(outcome, 0)
        while not content and simulated < budget:
            genes = mean + FINE_STEP * rng.normal(size=(SAMPLES, len(mean)))
            motions = [Variation.of(g).apply(target, start, self._robot) for g in genes]
            outcome = self.experiment.compare(scenarios, motions)
            rollouts += outcome.stood.size
            simulated += outcome.record.duration
            cost = self._weigh(outcome)
            order = np.argsort(cost, kind="stable")
            mean = _weights() @ genes[order[:PARENTS]]
            stands = np.asarray(outcome.stood.all(axis=1))
            best += [(float(cost[i]), motions[i]) for i in order if stands[i]]
            best = sorted(best, key=lambda one: one[0])[:FINALISTS]
            content = best[0][1] is motions[order[0]] and self._is_content(outcome, order[0])
        cheaper = [motion for cost, motion in best[:FINALISTS] if cost < begun]
        return Improvement(targets=cheaper, rollouts=rollouts, simulated=simulated)

    def _is_content(self, outcome: Outcome, i: int | np.int_) -> bool:
        """Return whether nothing cheaper than a motion is wanted."""
        return not (self.preference.always_improves or np.any(np.asarray(outcome.collides)[i]))

    def _weigh(self, outcome: Outcome) -> Array:
        """Weigh motions by their stands, how near the others came to one, and cost, (S,)."""
        cost = np.where(outcome.stood, self.preference.cost(outcome), NO_STAND)
        gain = outcome.stood + outcome.progress - EFFORT * cost  # (S, K)
        return -gain.mean(axis=1)


def _share(outcome: Outcome) -> float:
    """Return the share of the worlds in which a motion stands; 0 if not in the first."""
    return float(outcome.stood[0].mean()) if outcome.stood[0, 0] else 0.0


def _find_hardest(outcome: Outcome) -> NDArray[np.int_]:
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
