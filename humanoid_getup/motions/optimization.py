"""Trajectory optimization: CMA-ES adapts hand-written keyframes to the physics.

The ledger of a search keeps the costs of every generation. CMA-ES and the disturbances follow from
the seed, so feeding the costs to a new search brings it to the same state: a search that was
interrupted finds the same as one that was not, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import USUAL, Disturbance, Normal, Scenarios
from humanoid_getup.experiments.judging.outcome import compute_share
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.trial import SEARCH_HOLD, SWAY_TIME, KeyframePopulation, score
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.simulation.world import SEARCH_TIMESTEP, World
from robots import TorqueLimit
from robots.quaternion import Array

POPULATION = 14
"""Candidates of a generation."""


@dataclass(frozen=True, kw_only=True)
class Generation:
    """Result of one generation."""

    cost: Array
    """Mean cost of each candidate, (population,)."""
    stood: float
    """Share of the rollouts that succeeded."""


UNDISTURBED = 2  # at its own torque limit and at full torque
SCENARIOS = 5  # rollouts of each candidate: nominal, with full torque, three disturbed
LIMIT_SHARES = (0.73, 0.61)  # of stall torque, limits of disturbed rollouts beside the motion's own
FIRST_SHARE = 4  # generations that may look for a first success, for each of the search's own
FIRST_POPULATION = 24  # candidates of such a generation, each rolled out once
FIRST_STEP = 1.5  # of the first step sizes of the search for robust motions
FINAL_SCENARIOS = 48
FIRST_FINAL = 16  # of these, after which a judgement may end
PRACTICE = 96  # worlds from which those are chosen in which keyframes fail
FEW_FAILURES = 2  # of these, from which keyframes are good enough
HARD, EASY = 8, 4  # worlds of a generation in which they failed, and in which they did not
ROUNDS, EACH_ROUND = 3, 3  # choices of worlds, and generations after each
CAREFUL_STEP = 0.2  # of the first step sizes, for keyframes that succeed in most worlds
FINALISTS = 8  # best candidates of the last generations that are judged, beside start and mean
LEAD_IN = 0.1  # s in the start posture
Bounds = tuple[float, float]
"""Least and most torque limit of rollouts [N·m]."""
UNBOUNDED: Bounds = (0.0, math.inf)
MARGIN = replace(USUAL, joints=Normal(np.radians(4.5)), turn=Normal(np.radians(7.5)))


class TrajectoryOptimizer:
    """Optimizes keyframes of one robot in one scene."""

    def __init__(
        self,
        world: World,
        start: Array,
        *,
        preference: Preference | None = None,
        threads: int = 1,
        bounds: Bounds = UNBOUNDED,
    ) -> None:
        """Prepare to optimize from MuJoCo positions (nq,).

        Without a preference, time and torque cost what the keyframes say. Torque limits keep their
        bounds.
        """
        self.world, self.start, self.preference = world, start, preference
        self._bounds = bounds
        wants_margin = preference is not None and preference.wants_margin
        self._disturbance = MARGIN if wants_margin else USUAL
        coarse = world.vary(timestep=world.robot.choose_timestep(SEARCH_TIMESTEP))
        self._coarse = Experiment(coarse, threads=threads)
        self._fine = Experiment(world, threads=threads)
        self.simulated = 0.0
        """Time simulated so far [s]."""

    def optimize(
        self,
        keyframes: Keyframes,
        generations: int,
        seed: int,
        report: Callable[[int, float, float], None] = lambda *_: None,
        log: Ledger | None = None,
    ) -> tuple[Keyframes, float]:
        """Search key postures and times; return the best and its disturbed success share.

        After each generation its number, best cost and share that stood are reported. Generations
        that the log has are not rolled out again; others are added to it.
        """
        keyframes = self.find_success(keyframes, FIRST_SHARE * generations, seed) or keyframes
        rng = np.random.default_rng(seed)
        population = KeyframePopulation(keyframes, self.world.robot, size=POPULATION, seed=seed)
        finalists = [keyframes]
        for generation in range(generations):
            candidates = population.ask()
            found = self._evaluate(candidates, generation, rng, log)
            population.tell(found.cost)
            report(generation, float(found.cost.min()), found.stood)
            if generation >= generations - FINALISTS:
                finalists.append(candidates[int(np.argmin(found.cost))])
        finalists.append(population.mean)
        judged, share = list[tuple[float, np.ndarray]](), list[float]()
        for finalist in finalists:
            judged.append(self.judge(finalist, seed, least=max(share, default=0.0)))
            share.append(compute_share(judged[-1][1], UNDISTURBED))
        best = min(range(len(finalists)), key=lambda i: (-round(share[i], 2), judged[i][0]))
        return finalists[best], share[best]

    def improve(self, keyframes: Keyframes, seed: int) -> Keyframes:
        """Improve keyframes that succeed in most worlds, by those in which they fail.

        From a number of worlds, others than those of `judge`, candidates of a few generations are
        rolled out in those in which the mean of the last ones failed, and in some others. That ends
        with a mean that fails in no fewer worlds.
        """
        rng = np.random.default_rng([seed, 2])
        worlds = self.make_scenarios(keyframes, PRACTICE, rng)
        population = KeyframePopulation(
            keyframes, self.world.robot, size=POPULATION, seed=seed, step=CAREFUL_STEP
        )
        best, mean, fewest = keyframes, keyframes, PRACTICE + 1
        for number in range(ROUNDS + 1):
            failed = ~self._roll_out(self._fine, [mean], worlds, HOLD_TIME)[1][0]
            if failed.sum() >= fewest:
                break
            best, fewest = mean, int(failed.sum())
            if fewest <= FEW_FAILURES or number == ROUNDS:
                break
            hard = worlds.take(_choose_hard(failed, rng))
            for _ in range(EACH_ROUND):
                candidates = population.ask()
                population.tell(self._roll_out(self._coarse, candidates, hard, SEARCH_HOLD)[0])
            mean = population.mean
        return best

    def find_success(self, keyframes: Keyframes, generations: int, seed: int) -> Keyframes | None:
        """Change keyframes until they succeed once, undisturbed, at full torque.

        A search for robust motions learns nothing from candidates that all fail; this one is cheap.
        None if it finds none within a number of generations.
        """
        nominal = Scenarios.nominal(self._coarse.world, self.start)

        def try_once(candidates: list[Keyframes]) -> tuple[Array, np.ndarray]:
            cost, stood = self._roll_out(self._coarse, candidates, nominal, SEARCH_HOLD, lead_in=0)
            return cost, stood[:, 0]

        if try_once([keyframes])[1][0]:
            return keyframes
        population = KeyframePopulation(
            keyframes, self.world.robot, size=FIRST_POPULATION, seed=seed, step=FIRST_STEP
        )
        for _ in range(generations):
            candidates = population.ask()
            cost, succeeded = try_once(candidates)
            if succeeded.any():
                return candidates[int(np.argmin(np.where(succeeded, cost, np.inf)))]
            population.tell(cost)
        return None

    def _evaluate(
        self,
        candidates: list[Keyframes],
        generation: int,
        rng: np.random.Generator,
        log: Ledger | None,
    ) -> Generation:
        """Return the costs of a generation, from the log or else by rollouts."""
        scenarios = self.make_scenarios(candidates[0], SCENARIOS, rng)
        name = str(generation + 1)
        if log is not None and name in log.done:
            kept = log.done[name]
            return Generation(cost=np.array(kept["cost"], dtype=float), stood=kept["stood"])
        cost, stood = self._roll_out(
            self._coarse, candidates, scenarios, SEARCH_HOLD, self.preference
        )
        found = Generation(cost=cost, stood=float(stood.mean()))
        if log is not None:
            log.add(name, found)
        return found

    def judge(
        self, keyframes: Keyframes, seed: int, *, least: float = 0.0
    ) -> tuple[float, np.ndarray]:
        """Compute mean cost and successes (K,) over disturbances not used by the search.

        The first two are undisturbed: at its own torque limit and at full torque. Only the first
        are rolled out where so many of them fail that fewer of all than ``least`` would succeed.
        """
        rng = np.random.default_rng([seed, 1])
        scenarios = self.make_scenarios(keyframes, FINAL_SCENARIOS, rng)
        rows = np.arange(FINAL_SCENARIOS)
        costs, stood = list[float](), np.ones(FINAL_SCENARIOS, dtype=bool)
        for some in filter(len, (rows[:FIRST_FINAL], rows[FIRST_FINAL:])):
            cost, stands = self._roll_out(
                self._fine, [keyframes], scenarios.take(some), HOLD_TIME, self.preference
            )
            costs += [float(cost[0])] * len(some)
            stood[some] = stands[0]
            if compute_share(stood, UNDISTURBED) < least:  # even if all others stood
                break
        return float(np.mean(costs)), stood[: len(costs)]

    def _roll_out(
        self,
        experiment: Experiment,
        candidates: list[Keyframes],
        scenarios: Scenarios,
        hold: float,
        preference: Preference | None = None,
        *,
        lead_in: float = LEAD_IN,
    ) -> tuple[Array, np.ndarray]:
        """Roll candidates out in K scenarios; return mean cost and successes, (C,), (C, K)."""
        robot, each = self.world.robot, len(scenarios)
        lead = round(lead_in / robot.control_period)
        plays = [c.targets(robot, hold + SWAY_TIME) for c in candidates]
        length = max(len(play) for play in plays)
        targets = np.array(
            [np.concatenate([np.repeat(p[:1], lead, 0), hold_last(p, length)]) for p in plays]
        )
        n = len(candidates)
        record = experiment.play(scenarios.tile(n), np.repeat(targets, each, axis=0))
        self.simulated += record.duration
        durations = np.repeat([c.duration.sum() for c in candidates], each)
        cost, stood = score(record, self.world, candidates[0], hold, preference, durations)
        return cost.reshape(n, each).mean(axis=1), stood.reshape(n, each)

    def make_scenarios(
        self, keyframes: Keyframes, count: int, rng: np.random.Generator
    ) -> Scenarios:
        """Make scenarios for keyframes: two undisturbed, all others disturbed."""
        start, limit, disturbance = self.start, keyframes.torque_limit, self._disturbance
        return make_scenarios(
            self.world, start, limit, count, disturbance, rng, bounds=self._bounds
        )


def _choose_hard(failed: np.ndarray, rng: np.random.Generator) -> NDArray[np.int_]:
    """Choose the first world, some of those in which keyframes failed, and a few others."""
    wrong, right = np.flatnonzero(failed[1:]) + 1, np.flatnonzero(~failed[1:]) + 1
    return np.concatenate([[0], rng.permutation(wrong)[:HARD], rng.permutation(right)[:EASY]])


def make_scenarios(
    world: World,
    start: Array,
    own_limit: float,
    count: int,
    disturbance: Disturbance,
    rng: np.random.Generator,
    *,
    bounds: Bounds = UNBOUNDED,
) -> Scenarios:
    """Make scenarios from MuJoCo positions (nq,): two undisturbed, all others disturbed.

    The first is at the motion's own torque limit [N·m], the second at full torque. The disturbed
    ones take turns at that limit and at `LIMIT_SHARES`, in the robot's own mode, so that a motion
    succeeds under the limits that users set. All keep their bounds.
    """
    scenarios = disturbance.sample(world, start, count, rng, TorqueLimit(own_limit))
    starts, parameters = scenarios.starts, scenarios.parameters
    full, (least, most) = float(world.robot.max_torque.max()), bounds
    limits = np.array([own_limit, *(share * full for share in LIMIT_SHARES)])
    parameters.torque_limit[2:] = np.resize(np.clip(limits, least, most), count - 2)
    starts[1], parameters.torque_limit[1] = starts[0], min(full, most)
    parameters.friction[1] = parameters.friction[0]
    parameters.voltage[1] = parameters.voltage[0]
    return scenarios
