"""Trajectory optimization: CMA-ES adapts hand-written keyframes to the physics."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

import cma
import numpy as np

from humanoid_getup.evaluation.lying import LyingSide, measure_lying
from humanoid_getup.evaluation.preference import Preference
from humanoid_getup.evaluation.rise_figures import DEEP_OVERLAP, RiseFigures
from humanoid_getup.evaluation.standing import (
    HOLD_TIME,
    compute_progress,
    compute_uprightness,
    is_upright,
    measure_stance,
)
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import STANDING, hold_last
from humanoid_getup.motions.search_log import POPULATION, Generation, SearchLog
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.rollout import (
    Rollout,
    RolloutRandomization,
    Trace,
    randomize_rollouts,
)
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.quaternion import Array

SCENARIOS = 5  # rollouts of each candidate: nominal, with full torque, three disturbed
LIMIT_SHARES = (0.73, 0.61)  # of stall torque, limits of disturbed rollouts beside the motion's own
FINAL_SCENARIOS = 48
FINALISTS = 8  # best candidates of the last generations that are judged, beside start and mean
ANGLE_STEP, TIME_STEP = 0.12, 0.12  # first step size: rad, and share of a duration
SEARCH_HOLD = 1.0  # s of stand or of lying still that a candidate must show; 3.0 when judged
LEAD_IN = 0.1  # s in the start posture
TRAVEL_COST = 0.02  # of a radian that the targets of a joint travel, on average
SWAY_TIME = 0.2  # s between the last target and the stand that counts
SEARCH_TIMESTEP = 0.004  # s; the result is judged, recorded and verified at 0.002
OVERLAP_COST = 1.0  # of pressing into itself all the time
FAILURE = 6.0  # cost that no success can reach
PREFERENCE_SHARE = 0.3  # of a preference's cost, so that no success costs as much as a failure
MARGIN = RolloutRandomization(joints=np.radians(4.5), root=np.radians(7.5))
DESCENT_COST = 6.0  # of a meter per second at which the neck of a robot that lies down descends


def score(
    trace: Trace,
    world: World,
    keyframes: Keyframes,
    hold: float,
    preference: Preference | None = None,
    duration: Array | None = None,
) -> tuple[Array, np.ndarray]:
    """Compute the cost of each rollout, (N,), and whether it ended as it should, (N,).

    ``duration`` [s], (N,), is that of the keyframes in each; ``None`` for those given.
    """
    if keyframes.end_class == STANDING:
        missed, succeeded, time = _judge_rise(trace, world, hold)
    else:
        missed, succeeded = _judge_lying_down(trace, world, keyframes.end_class)
        time = np.full(len(missed), keyframes.duration.sum()) if duration is None else duration
    travel = np.abs(np.diff(trace.target, axis=1)).sum(axis=1).mean(axis=1)
    collides = np.mean(trace.overlap > DEEP_OVERLAP, axis=1)
    effort = TRAVEL_COST * travel + OVERLAP_COST * collides
    figures = RiseFigures.of_trace(trace, world, time)
    if preference is None:
        preferred = keyframes.time_cost * time + keyframes.torque_cost * figures.rms_torque
    else:
        preferred = PREFERENCE_SHARE * preference.cost(figures)
    return missed + effort + preferred, succeeded


def _judge_lying_down(trace: Trace, world: World, side: LyingSide) -> tuple[Array, np.ndarray]:
    lying = measure_lying(world, trace, side)
    missed = FAILURE + np.minimum(lying.lean, 2.0) + np.minimum(lying.sway, 1.0)
    return np.where(lying.lies, 0.0, missed) + DESCENT_COST * lying.descent, lying.lies


def _judge_rise(trace: Trace, world: World, hold: float) -> tuple[Array, np.ndarray, Array]:
    """Return what failures cost, which rollouts stood, and since when [s]; 0 for failures."""
    robot, period = world.robot, trace.period
    stance = measure_stance(world, trace)
    upright = is_upright(stance, robot)
    last = round(hold / period)
    stood = np.asarray(upright[:, -last:].all(axis=1))
    begin = (upright.shape[1] - np.argmax(~upright[:, ::-1], axis=1)) * period
    near = compute_uprightness(stance, robot)
    best = np.array([np.convolve(row, np.full(25, 1 / 25), "valid").max() for row in near])
    progress = compute_progress(near[:, -last:].mean(axis=1), best)
    held = upright[:, -last:].mean(axis=1)
    missed = FAILURE + 4.0 * (1.0 - progress) + 2.0 * (1.0 - held)
    return np.where(stood, 0.0, missed), stood, np.where(stood, begin, 0.0)


class TrajectoryOptimizer:
    """Optimizes keyframes of one robot in one scene."""

    def __init__(
        self,
        world: World,
        start: Array,
        *,
        preference: Preference | None = None,
        threads: int = 1,
    ) -> None:
        """Prepare to optimize from MuJoCo positions (nq,).

        Without a preference, time and torque cost what the keyframes say.
        """
        self.world, self.start, self.preference = world, start, preference
        wants_margin = preference is not None and preference.wants_margin
        self._randomization = MARGIN if wants_margin else RolloutRandomization()
        coarse = World(world.robot, world.scene, model=copy.copy(world.model))
        coarse.model.opt.timestep = _coarse_step(world)
        self._search = Rollout(coarse, POPULATION * SCENARIOS, threads=threads)
        self._final = Rollout(world, FINAL_SCENARIOS, threads=threads)

    def optimize(
        self,
        keyframes: Keyframes,
        generations: int,
        seed: int,
        report: Callable[[int, float, float], None] = lambda *_: None,
        log: SearchLog | None = None,
    ) -> tuple[Keyframes, float]:
        """Search key postures and times; return the best and its disturbed success share.

        After each generation its number, best cost and share that stood are reported. Generations
        that the log has are not rolled out again; others are added to it.
        """
        robot = self.world.robot
        rng = np.random.default_rng(seed)
        count = len(keyframes.duration)
        scale = np.full(len(keyframes.genes), ANGLE_STEP)
        scale[:count] = TIME_STEP
        options = {"popsize": POPULATION, "seed": seed + 1, "verbose": -9}
        search = cma.CMAEvolutionStrategy(keyframes.genes / scale, 1.0, options)
        finalists = [keyframes]
        for generation in range(generations):
            genes = search.ask()
            candidates = [keyframes.with_genes(g * scale, robot) for g in genes]
            found = self._evaluate(candidates, generation, rng, log)
            search.tell(genes, found.cost.tolist())
            report(generation, float(found.cost.min()), found.stood)
            if generation >= generations - FINALISTS:
                finalists.append(candidates[int(np.argmin(found.cost))])
        finalists.append(keyframes.with_genes(search.mean * scale, robot))
        judged = [self.judge(finalist, seed) for finalist in finalists]
        best = min(range(len(finalists)), key=lambda i: (-round(judged[i][1], 2), judged[i][0]))
        return finalists[best], judged[best][1]

    def _evaluate(
        self,
        candidates: list[Keyframes],
        generation: int,
        rng: np.random.Generator,
        log: SearchLog | None,
    ) -> Generation:
        """Return the costs of a generation: from the log, else by rollouts."""
        if log is not None and generation < len(log.generations):
            self._make_scenarios(candidates[0], SCENARIOS, rng)  # draws what they were drawn from
            return log.generations[generation]
        cost, stood = self._roll_out(self._search, candidates, SCENARIOS, rng, SEARCH_HOLD)
        if log is None:
            return Generation(cost=cost, stood=float(stood.mean()))
        log.add(cost, float(stood.mean()))
        return log.generations[-1]

    def judge(self, keyframes: Keyframes, seed: int) -> tuple[float, float]:
        """Compute mean cost and success share over disturbances that the search never saw.

        The share is 0 if it fails undisturbed, at its own torque limit or at full torque.
        """
        rng = np.random.default_rng([seed, 1])
        cost, stood = self._roll_out(self._final, [keyframes], FINAL_SCENARIOS, rng, HOLD_TIME)
        share = float(stood.mean()) if stood[0, :2].all() else 0.0
        return float(cost.mean()), share

    def _roll_out(
        self,
        rollout: Rollout,
        candidates: list[Keyframes],
        each: int,
        rng: np.random.Generator,
        hold: float,
    ) -> tuple[Array, np.ndarray]:
        """Roll candidates out ``each`` times; return mean cost and successes, (C,), (C, each).

        A success is a stand that lasts the last ``hold`` seconds, or lying as it should.
        """
        robot = self.world.robot
        lead = round(LEAD_IN / robot.control_period)
        plays = [c.targets(robot, hold + SWAY_TIME) for c in candidates]
        length = max(len(play) for play in plays)
        targets = np.array(
            [np.concatenate([np.repeat(p[:1], lead, 0), hold_last(p, length)]) for p in plays]
        )
        starts, parameters = self._make_scenarios(candidates[0], each, rng)
        n = len(candidates)
        trace = rollout.play(
            np.tile(starts, (n, 1)),
            np.repeat(targets, each, axis=0),
            parameters.tile(n),
        )
        durations = np.repeat([c.duration.sum() for c in candidates], each)
        cost, stood = score(trace, self.world, candidates[0], hold, self.preference, durations)
        return cost.reshape(n, each).mean(axis=1), stood.reshape(n, each)

    def _make_scenarios(
        self, keyframes: Keyframes, count: int, rng: np.random.Generator
    ) -> tuple[Array, DomainParameters]:
        limit = keyframes.torque_limit
        return make_scenarios(self.world, self.start, limit, count, self._randomization, rng)


def count_work(generations: int, done: int = 0) -> float:
    """Count the work of a search in generations, beside those done; finalists are judged too."""
    judged = (min(generations, FINALISTS) + 2) * FINAL_SCENARIOS
    finer = 2.0  # half the search's physics step
    return max(generations - done, 0) + finer * judged / (POPULATION * SCENARIOS)


def make_scenarios(
    world: World,
    start: Array,
    own_limit: float,
    count: int,
    randomization: RolloutRandomization,
    rng: np.random.Generator,
) -> tuple[Array, DomainParameters]:
    """Make starts (count, nq) and parameters: two undisturbed, all others disturbed.

    The first is at the motion's own torque limit [N·m], the second at full torque. The disturbed
    ones take turns at that limit and at `LIMIT_SHARES`, in the robot's own mode, so that a motion
    succeeds under the limits that users set.
    """
    starts, parameters = randomize_rollouts(
        world, start, count, randomization, TorqueLimit(own_limit), rng
    )
    full = float(world.robot.max_torque.max())
    limits = np.array([own_limit, *(share * full for share in LIMIT_SHARES)])
    parameters.torque_limit[2:] = np.resize(limits, count - 2)
    starts[1], parameters.torque_limit[1] = starts[0], full
    parameters.friction[1] = parameters.friction[0]
    parameters.voltage[1] = parameters.voltage[0]
    return starts, parameters


def _coarse_step(world: World) -> float:
    """Return the search's physics step [s]: at most 4 ms, so that steps fill a control period."""
    period = world.robot.control_period
    return max(period / math.ceil(period / SEARCH_TIMESTEP - 1e-9), world.model.opt.timestep)
