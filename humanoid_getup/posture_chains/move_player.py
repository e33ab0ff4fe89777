"""Plays moves from resting states, and measures where they end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import USUAL, Disturbance, Normal, Scenarios, Uniform
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.judging.torque import find_saturation
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.posture_chains.goal import Goal
from humanoid_getup.posture_chains.resting_state import (
    Archive,
    Arrivals,
    Bools,
    PostureChain,
    PostureMove,
    RestingState,
    TriedMove,
    are_near,
    list_resting,
    make_state,
    sample_moves,
)
from humanoid_getup.simulation.physics_engine import find_coarse_step
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot, TorqueLimit
from robots.body.parts import leg_length
from robots.quaternion import Array

ROUGH = Disturbance(ground_friction=Uniform(0.6, 1.2), supply=Uniform(0.95, 1.05))
"""What a move has to withstand, beside `JOINT_NOISE`: all worlds must come to rest alike."""
JOINT_NOISE = Normal(0.015)  # rad, at the start of a move
OP3_LEG = 0.22  # m; times scale with the root of a leg's length
SETTLING = 0.35  # s for OP3, the rest after each move
REST_TIME = 0.06  # s at the end of a move over which a robot's speed is measured
REST_JOINT_SPEED, REST_ROOT_SPEED = 0.6, 0.06  # rad/s, and m/s for OP3
MOST_OVERLAP = 0.008  # m by which a robot may press into itself
PRESSING = 0.5  # of the torque limit, for servos that had pressed with all their torque
FINER = 2  # physics steps a control period of a check in the undisturbed world
STANDS = -1
"""Of a chain that ends in a held stand."""
MISSES = 3  # disturbed worlds of eight in which a chain that is kept may fall


@dataclass(frozen=True, kw_only=True, eq=False)
class Followed:
    """How M chains end that are played whole."""

    lost: NDArray[np.int_]
    """`STANDS` where a chain ends in a held stand in nearly all worlds; else the number of the
    first state of its path that is missed in too many, (M,)."""
    fallen: NDArray[np.int_]
    """Worlds in which each does not, (M,)."""
    stand: Bools
    """Which ones do in the undisturbed world, (M,)."""


def measure_time_scale(robot: Robot) -> float:
    """Measure the times of a robot as a factor on those of OP3."""
    return float(np.sqrt(leg_length(robot) / OP3_LEG))


class MovePlayer:
    """Plays moves in one world: roughly to try them, disturbed to check them.

    A trial simulates in the longest stable physics steps, which is enough to tell which moves are
    worth a check; a check simulates the undisturbed world in finer steps. A whole chain is
    judged by a held stand, undisturbed in the world's own steps, disturbed in those of a check.
    """

    def __init__(
        self,
        world: World,
        goal: Goal,
        rng: np.random.Generator,
        *,
        limit: TorqueLimit = FULL_TORQUE,
        weakest: float = 1.0,
        threads: int = 0,
    ) -> None:
        """Prepare for a world, for where moves are to lead, and for a torque limit of every servo.

        In every other disturbed world, ``weakest`` is the share of that limit that is left.
        """
        self.world, self._rng, self._limit, self._weakest = world, rng, limit, weakest
        step, full = find_coarse_step(world), world.robot.max_torque
        self._trial = Experiment(world.vary(timestep=step), threads=threads)
        self._experiment = Experiment(world, threads=threads)
        finer = min(step, world.robot.control_period / FINER)
        self._finer = Experiment(world.vary(timestep=finer), threads=threads)
        torque = full if limit.value is None else np.minimum(full, limit.value)
        self._most_lead = np.abs(world.robot.compute_lead(PRESSING * torque))
        self._layout = world.robot.layout(world.model)
        self.goal, self._meter = goal, goal.meter
        self.scale = measure_time_scale(world.robot)
        """Times of this robot over those of OP3."""
        self.simulated = 0.0
        """Time simulated so far [s]."""

    @property
    def rest(self) -> float:
        """Return the time of rest after each move [s]."""
        return SETTLING * self.scale

    def describe(self, qpos: Array, target: Array) -> RestingState:
        """Describe a robot at rest at MuJoCo positions (nq,), with held targets (n,)."""
        return make_state(qpos, target, self._meter.measure(qpos[None]), 0)

    def settle(self, start: RestingState, scenarios: Scenarios, worlds: int) -> Array:
        """Hold a start in scenarios; return where robots come to rest near it in K, (K, nq)."""
        hold = PostureMove(knots=start.target[None], duration=self.rest, kind="hold")
        ends = self._arrive(self._trial, scenarios, self._sample([start], [[hold]]))
        stay = np.flatnonzero(are_near(ends.features.cells, start.cell))
        rested = ends.qpos[0, stay] if stay.size else start.qpos[None]
        return rested[np.arange(worlds) % len(rested)]

    def try_out(self, states: Sequence[RestingState], moves: Sequence[PostureMove]) -> Arrivals:
        """Play a move from each of M states, undisturbed and coarsely."""
        targets = self._sample(states, [[move] for move in moves])
        return self._arrive(self._trial, self._make_nominal(states), targets)

    def explore(
        self, states: Sequence[RestingState], moves: Sequence[PostureMove], archive: Archive
    ) -> list[RestingState]:
        """Try a move from each of M states; return where they rest, if an archive wants that.

        Stands are always returned.
        """
        new = list[RestingState]()
        for tried in self.try_softly(states, moves):
            begun = tried.begun
            state = replace(tried.end, before=begun, move=tried.move, depth=begun.depth + 1)
            if tried.stands or archive.wants(state):
                new.append(state)
        return new

    def try_softly(
        self, states: Sequence[RestingState], moves: Sequence[PostureMove]
    ) -> Iterator[TriedMove]:
        """Try a move from each of M states; yield those that end at rest.

        Where servos would press with all their torque, the move is tried again to targets near the
        angles that the joints came to.
        """
        tried = self.try_out(states, moves)
        yield from list_resting(states, moves, tried)
        rows = np.flatnonzero(tried.presses[:, 0]).tolist()
        if rows:
            softer = [self._soften(moves[k], tried.qpos[k, 0]) for k in rows]
            begun = [states[k] for k in rows]
            yield from list_resting(begun, softer, self.try_out(begun, softer))

    def _soften(self, move: PostureMove, qpos: Array) -> PostureMove:
        """Move the last targets of a move towards the angles at which it ended, (nq,)."""
        robot, ended = self.world.robot, qpos[self._layout.qpos]
        lead = np.clip(move.target - ended, -self._most_lead, self._most_lead)
        target = np.clip(ended + lead, robot.lower, robot.upper)
        return replace(move, knots=np.vstack([move.knots[:-1], target]))

    def check(
        self, states: Sequence[RestingState], moves: Sequence[PostureMove], worlds: int
    ) -> Arrivals:
        """Play a move from each of M states in K worlds, the first undisturbed.

        In the others robots begin where the moves before have led them in as many worlds, if that
        is known: along a chain of thirty, small deviations would add up unseen.
        """
        targets = self._sample(states, [[move] for move in moves])
        first = self._arrive(self._finer, self._make_nominal(states), targets)
        if worlds == 1:
            return first
        return first.join(self._arrive(self._trial, self._disturb(states, worlds - 1), targets))

    def lead(
        self,
        states: Sequence[RestingState],
        moves: Sequence[PostureMove],
        goals: Sequence[RestingState],
        worlds: int,
    ) -> list[PostureMove | None]:
        """Check moves from M states that are to lead to goals, in K worlds.

        Returns:
            Each move that leads to its goal, with softer targets where servos would press there
            with all their torque; None for one that does not.
        """
        ends = self.check(states, moves, worlds)
        leads = ends.are_like(goals)
        led = [move if does else None for move, does in zip(moves, leads, strict=True)]
        presses = ends.are_like(goals, pressing=True) & ~leads
        if rows := np.flatnonzero(presses).tolist():
            softer = [self._soften(moves[k], ends.qpos[k, 0]) for k in rows]
            again = self.check([states[k] for k in rows], softer, worlds)
            for row in np.flatnonzero(again.are_like([goals[k] for k in rows])):
                led[rows[row]] = softer[row]
        return led

    def repeat_last(
        self, states: Sequence[RestingState], worlds: int
    ) -> tuple[Arrivals, list[RestingState]]:
        """Check the last moves of M states in K worlds; return their ends, and states as there."""
        begun = [state.before for state in states if state.before is not None]
        moves = [state.move for state in states if state.move is not None]
        ends = self.check(begun, moves, worlds)
        pairs = zip(states, ends.qpos, strict=True)
        return ends, [replace(one, qpos=at[0].copy(), arrivals=at[1:].copy()) for one, at in pairs]

    def are_near(self, state: RestingState, qpos: Array) -> bool:
        """Tell whether robots at MuJoCo positions (K, nq) are all near to a state."""
        return bool(np.all(are_near(self._meter.measure(qpos).cells, state.cell)))

    def trace(self, chain: PostureChain) -> list[RestingState]:
        """Play a chain once, undisturbed; return its start and where each of its moves ends."""
        period, targets = self.world.robot.control_period, [chain.held]
        targets += [move.target for move in chain.moves]
        starts = Scenarios.nominal(self.world, chain.start[None], self._limit)
        record = self._finer.play(starts, chain.sample(period, self.rest)[None])
        self.simulated += record.duration
        ends = record.qpos[0, np.array(chain.list_ends(period, self.rest)) - 1]
        return list(map(self.describe, [chain.start, *ends], targets))

    def follow(self, ends: Sequence[RestingState], scenarios: Scenarios) -> Followed:
        """Play M whole chains, given by their ends, in K scenarios of their start.

        The first is undisturbed, and played in the world's own physics steps.
        """
        paths = [end.path for end in ends]
        chains = [(*end.chain.moves, *self.goal.onward) for end in ends]
        targets = self._sample([path[0] for path in paths], chains)
        hold = round(HOLD_TIME / self.world.robot.control_period) + 1
        targets = np.pad(targets, ((0, 0), (0, hold), (0, 0)), "edge")
        first, others = scenarios.take(np.arange(1)), scenarios.take(np.arange(1, len(scenarios)))
        found = self._find_lost(self._experiment, paths, targets, first, misses=0)
        if (standing := np.flatnonzero(found.stand)).size:
            some = [paths[int(k)] for k in standing]
            further = self._find_lost(self._finer, some, targets[standing], others, MISSES)
            found.lost[standing], found.fallen[standing] = further.lost, further.fallen
        return found

    def _find_lost(
        self,
        experiment: Experiment,
        paths: Sequence[list[RestingState]],
        targets: Array,
        scenarios: Scenarios,
        misses: int,
    ) -> Followed:
        """Play targets (M, T, n) in scenarios; find where more chains than permitted are lost."""
        each = len(scenarios)
        sent = np.repeat(targets, each, axis=0)
        record = experiment.play(scenarios.tile(len(targets)), sent, stop_early=True)
        self.simulated += record.duration
        stood = Outcome(record, self.world.robot).stood.reshape(-1, each)
        lost, fallen = np.full(len(paths), STANDS), np.sum(~stood, axis=1)
        found = Followed(lost=lost, fallen=fallen, stand=stood[:, 0])
        for k in np.flatnonzero(found.fallen > misses):
            rows = slice(each * int(k), each * (int(k) + 1))
            found.lost[k] = self._find_missed(paths[int(k)], record, rows, misses)
        return found

    def _find_missed(
        self, path: list[RestingState], record: Record, rows: slice, misses: int
    ) -> int:
        """Find the first state of a path that too many worlds, rows of a record, have missed."""
        period, at = self.world.robot.control_period, 0
        qpos, stopped = record.qpos[rows], np.where(record.failed, record.cycles, np.inf)[rows]
        for number, state in enumerate(path[1:-1], start=1):
            assert state.move is not None
            at += len(state.move.sample(state.target, period, self.rest))
            cells = self._meter.measure(qpos[:, min(at, qpos.shape[1]) - 1]).cells
            if np.sum(~are_near(cells, state.cell) | (stopped < at)) > misses:
                return number
        return len(path) - 1

    def sample_worlds(self, start: Array, worlds: int) -> Scenarios:
        """Sample the worlds in which whole chains are played; the first is undisturbed.

        They start from MuJoCo positions (nq,), and are the same ones for the same start.
        """
        rng = np.random.default_rng(0)
        usual = USUAL.on_slope(self.world.scene)
        scenarios = usual.sample(self.world, start, worlds, rng, self._limit)
        scenarios.parameters.torque_limit[1::2] *= self._weakest
        return scenarios

    def _make_nominal(self, states: Sequence[RestingState]) -> Scenarios:
        starts = np.array([state.qpos for state in states])
        return Scenarios.nominal(self.world, starts, self._limit)

    def _disturb(self, states: Sequence[RestingState], worlds: int) -> Scenarios:
        """Make disturbed scenarios from M states, K of each, (M * K,)."""
        starts = np.concatenate([state.list_arrivals(worlds) for state in states])
        rough = ROUGH.on_slope(self.world.scene)
        parameters = rough.draw(self.world, len(starts), self._rng, self._limit)
        parameters.torque_limit.reshape(-1, worlds)[:, ::2] *= self._weakest
        noise = JOINT_NOISE.draw(self._rng, len(starts), self.world.robot.n)
        starts[:, self._layout.qpos] += noise
        return Scenarios(starts=starts, parameters=parameters)

    def _arrive(self, experiment: Experiment, scenarios: Scenarios, targets: Array) -> Arrivals:
        """Play targets (M, T, n) in scenarios (M * K,); measure where robots end."""
        each = len(scenarios) // len(targets)
        record = experiment.play(scenarios, np.repeat(targets, each, axis=0))
        self.simulated += record.duration
        ends, rests = record.qpos[:, -1], self._find_resting(record)
        presses = self._find_pressing(record, scenarios.parameters.voltage)
        return Arrivals(
            qpos=ends.reshape(-1, each, ends.shape[1]),
            features=self._meter.measure(ends),
            rests=(rests & ~presses).reshape(-1, each),
            presses=(rests & presses).reshape(-1, each),
            stands=self.goal.is_reached(record, self._rest_steps).reshape(-1, each),
        )

    def _sample(
        self, states: Sequence[RestingState], moves: Sequence[Sequence[PostureMove]]
    ) -> Array:
        """Sample the targets of sequences of moves, all as long as the longest, (M, T, n)."""
        period = self.world.robot.control_period
        sampled = [
            sample_moves(state.target, sequence, period, self.rest)
            for state, sequence in zip(states, moves, strict=True)
        ]
        length = max(map(len, sampled))
        return np.array([np.pad(s, ((0, length - len(s)), (0, 0)), "edge") for s in sampled])

    @property
    def _rest_steps(self) -> int:
        return max(round(REST_TIME / self.world.robot.control_period), 2)

    def _find_resting(self, record: Record) -> Bools:
        """Tell which robots are at rest at the end, and never pressed into themselves, (N,)."""
        steps, root = self._rest_steps, record.qpos[:, :, self._layout.root_position]
        turned = np.abs(record.joint_pos[:, -1] - record.joint_pos[:, -1 - steps]).max(axis=1)
        moved = np.linalg.norm(root[:, -1] - root[:, -1 - steps], axis=1)
        time = steps * record.period
        slow = (turned < REST_JOINT_SPEED * time) & (moved < REST_ROOT_SPEED * self.scale * time)
        if record.overlap is not None:
            slow &= record.overlap.max(axis=1) < MOST_OVERLAP
        return slow & ~record.diverged

    def _find_pressing(self, record: Record, voltage: Array) -> Bools:
        """Tell which robots have a servo that is saturated at the end at the supply [V], (N,)."""
        steps = self._rest_steps
        torque, velocity = record.torque[:, -steps:], record.actuator_vel[:, -steps:]
        saturated = find_saturation(self.world.robot, torque, velocity, voltage[:, np.newaxis])
        return np.any(np.all(saturated, axis=1), axis=1)
