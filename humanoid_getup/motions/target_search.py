"""Search: varies targets until a motion stands in every disturbed world, or costs less."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome, compute_share
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.preference import Preference
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import SEARCH_TIMESTEP, World
from robots import Robot
from robots.quaternion import Array

MANY_DOFS = 40  # OP3 has 26 and steps in 24 µs, the human 55 and 95 µs


def coarsen(world: World) -> World:
    """Return a world that costs less to simulate, or the world itself if its robot is small.

    Its physics step is longer, and joints have no dry friction: 2.7 times as fast for the human.
    """
    if world.model.nv <= MANY_DOFS:
        return world
    timestep = world.robot.choose_timestep(SEARCH_TIMESTEP)
    return world.vary(timestep=max(timestep, world.model.opt.timestep), dry_friction=False)


SAMPLES = 10  # variations of a generation
HARDEST = 4  # worlds in which every variation is rolled out
RIVALS = 2  # best variations of a generation that may be rolled out in the other worlds
STEP = 0.4  # standard deviation of a generation's genes
EFFORT = 0.02  # weight of 1 s of a preference's cost; a stand is worth 1, progress to it up to 1
NO_STAND = 10.0  # s, cost of a rise that fails, beside the stand that it misses
FINE_STEP = 0.25  # standard deviation of the genes of a motion that stands
FINALISTS = 3  # cheapest variations that an improvement returns


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """Variations of a motion that cost less and stand in all worlds of the search."""

    targets: list[Array]
    """Their targets [rad], each (T, n), the cheapest first; none if no cheaper one was found."""
    rollouts: int
    """How often a variation was rolled out in a world."""
    simulated: float
    """Simulated time, all rollouts together [s]."""


@dataclass(frozen=True, kw_only=True)
class FoundTargets:
    """Result of a search."""

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

    Disturbed worlds differ much in how hard they are, and most variations fail. So each is
    rolled out in the nominal world and in those that are hardest for the best targets so far; only
    one that stands in all of them is rolled out in the others, too.
    """

    def __init__(
        self,
        world: World,
        *,
        preference: Preference,
        threads: int = 0,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        self.preference, self.monitor = preference, monitor or ProgressMonitor()
        self.experiment = Experiment(world, threads=threads)
        self.world = world

    def search(
        self, scenarios: Scenarios, target: Array, budget: float, rng: np.random.Generator
    ) -> FoundTargets:
        """Vary targets [rad], (T, n), that stand in few worlds or none.

        The search ends when they stand in all worlds, of which the first is the nominal one, or
        when the budget of simulated time [s] is spent.
        """
        tries = _Tries(self, scenarios, target, STEP, budget, rng)
        outcome = tries.compare(scenarios, [target])
        best, share, hardest = target, compute_share(outcome.stood[0]), _find_hardest(outcome)
        while share < 1.0 and tries.simulated < budget:
            generation = tries.vary(scenarios.take(hardest))
            for i in generation.order[:RIVALS]:
                if not generation.outcome.stood[i].all():
                    break
                motion = generation.motions[i]
                whole = tries.compare(scenarios, [motion])
                if (reached := compute_share(whole.stood[0])) > share:
                    best, share, hardest = motion, reached, _find_hardest(whole)
                    break
        return FoundTargets(
            target=best,
            share=share,
            generations=tries.generations,
            rollouts=tries.rollouts,
            simulated=tries.simulated,
        )

    def improve(
        self, scenarios: Scenarios, target: Array, budget: float, rng: np.random.Generator
    ) -> Improvement:
        """Vary targets [rad], (T, n), that stand in few worlds, so that they cost less there.

        The budget is simulated time [s]. The search ends earlier if the motion is cheap enough.
        """
        tries = _Tries(self, scenarios, target, FINE_STEP, budget, rng)
        outcome = tries.compare(scenarios, [target])
        begun = float(self.weigh(outcome)[0])
        best = [(begun, target)]
        content = self._is_content(outcome, 0)
        while not content and tries.simulated < budget:
            generation = tries.vary(scenarios)
            outcome, order, motions = generation.outcome, generation.order, generation.motions
            stands = np.asarray(outcome.stood.all(axis=1))
            best += [(float(generation.cost[i]), motions[i]) for i in order if stands[i]]
            best = sorted(best, key=lambda one: one[0])[:FINALISTS]
            content = best[0][1] is motions[order[0]] and self._is_content(outcome, order[0])
        cheaper = [motion for cost, motion in best if cost < begun]
        return Improvement(targets=cheaper, rollouts=tries.rollouts, simulated=tries.simulated)

    def _is_content(self, outcome: Outcome, i: int | np.int_) -> bool:
        """Return whether a motion is cheap enough to end the search."""
        return not (self.preference.always_improves or np.any(np.asarray(outcome.collides)[i]))

    def weigh(self, outcome: Outcome) -> Array:
        """Compute the cost of motions from their stands, their progress and their effort, (S,)."""
        cost = np.where(outcome.stood, self.preference.cost(outcome), NO_STAND)
        gain = outcome.stood + outcome.progress - EFFORT * cost  # (S, K)
        return -gain.mean(axis=1)


@dataclass(frozen=True, kw_only=True)
class _Generation:
    """Variations of a generation, and their outcomes."""

    motions: list[Array]
    """Their targets [rad], each (T, n)."""
    outcome: Outcome
    """(S, K)"""
    cost: Array
    """(S,)"""
    order: NDArray[np.int_]
    """Their rows, the cheapest first."""


class _Tries:
    """Rolls out variations of targets, and counts the effort."""

    def __init__(
        self,
        search: TargetSearch,
        scenarios: Scenarios,
        target: Array,
        step: float,
        budget: float,
        rng: np.random.Generator,
    ) -> None:
        """Begin at targets [rad], (T, n), with a standard deviation of the genes.

        The budget of simulated time [s] is for the reports.
        """
        self._search, self._target, self._robot = search, target, search.world.robot
        self._budget = budget
        self._start = scenarios.starts[0, self._robot.layout(search.world.model).qpos]
        genes = np.zeros(Variation.size(self._robot))
        self._population = EvolutionStrategy(genes, step, SAMPLES, rng)
        self.generations = self.rollouts = 0
        self.simulated = 0.0
        """Simulated time [s]."""

    def compare(self, scenarios: Scenarios, motions: list[Array]) -> Outcome:
        """Roll motions out in worlds."""
        outcome = self._search.experiment.compare(scenarios, motions)
        self.rollouts += outcome.stood.size
        self.simulated += outcome.record.duration
        self._search.monitor.show(
            Progress(
                phase="varying targets [s simulated]",
                done=self.simulated,
                total=self._budget,
                note=f"{self.rollouts} rollouts",
            )
        )
        return outcome

    def vary(self, scenarios: Scenarios) -> _Generation:
        """Roll the variations of the next generation out in worlds."""
        self.generations += 1
        variations = [Variation.of(genes) for genes in self._population.ask()]
        motions = [one.apply(self._target, self._start, self._robot) for one in variations]
        outcome = self.compare(scenarios, motions)
        cost = self._search.weigh(outcome)
        order = self._population.tell(cost)
        return _Generation(motions=motions, outcome=outcome, cost=cost, order=order)


def _find_hardest(outcome: Outcome) -> NDArray[np.int_]:
    """Return the nominal world and those in which a motion does worst, (HARDEST,)."""
    others = np.arange(1, outcome.stood.shape[1])
    if outcome.stood[0, 0]:
        merit = (outcome.stood + outcome.progress)[0, others]
        others = others[np.argsort(merit, kind="stable")]
    return np.sort(np.concatenate([[0], others[: HARDEST - 1]]))


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


STRETCHES = 6  # of equal duration, each with a tempo and a posture of its own
UNIT_TEMPO, UNIT_OFFSET = 0.3, 0.15  # logarithm of a duration, and rad: 1 in a gene
LONGEST, SHORTEST = 2.1, 0.5  # share of its own duration that a stretch may last


@dataclass(frozen=True, kw_only=True)
class Variation:
    """Change of targets against those at the start of a search."""

    tempo: Array
    """Logarithm of the factor on the duration of each stretch, (STRETCHES,)."""
    offset: Array
    """Offset of each pair of joints at the knots [rad], (STRETCHES, pairs). The knots divide the
    motion evenly; at its first and last target there is no offset."""

    @staticmethod
    def size(robot: Robot) -> int:
        """Return the count of numbers in a variation."""
        return STRETCHES * (1 + len(pair_directions(robot)))

    @staticmethod
    def of(genes: Array) -> Variation:
        """Read a variation from its numbers (size,); 1 is a large change, 0 is none."""
        offset = UNIT_OFFSET * genes[STRETCHES:]
        return Variation(tempo=UNIT_TEMPO * genes[:STRETCHES], offset=offset.reshape(STRETCHES, -1))

    def apply(self, target: Array, start: Array, robot: Robot) -> Array:
        """Change targets [rad], (T, n), that are sent from joint angles (n,) on.

        The result keeps the joints' limits and the servos' speed.
        """
        last = len(target) - 1
        ends = np.linspace(0.0, last, STRETCHES + 1)
        stretch = np.clip(np.exp(self.tempo), SHORTEST, LONGEST)
        clock = np.concatenate([[0.0], np.cumsum(np.diff(ends) * stretch)])
        at = np.interp(np.arange(int(np.ceil(clock[-1])) + 1), clock, ends)
        knots = np.linspace(0.0, last, STRETCHES + 2)
        offset = np.pad(self.offset, ((1, 1), (0, 0)))
        played = _interpolate(at, np.arange(last + 1.0), target)
        shift = _interpolate(at, knots, offset) @ pair_directions(robot)
        return robot.limit_targets(played + shift, start)


def pair_directions(robot: Robot) -> Array:
    """Return what each mirrored pair of joints that rises moves, (pairs, n)."""
    chosen = (*robot.rising_joints, *robot.spreading_joints)
    one = np.eye(robot.n)[[robot.joint_names.index(name) for name in chosen]]
    return one + robot.mirror_joints(one)


def _interpolate(at: Array, time: Array, rows: Array) -> Array:
    return np.stack([np.interp(at, time, column) for column in rows.T], axis=1)
