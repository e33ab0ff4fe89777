"""Plays moves from resting states, and measures where they end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances.distributions import Normal, Uniform
from humanoid_getup.experiments.disturbances.disturbance import (
    USUAL,
    Disturbance,
    Scenarios,
)
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.judging.torque import find_saturation
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.posture_chains.archive import Archive
from humanoid_getup.posture_chains.features import Features, Meter
from humanoid_getup.posture_chains.resting_state import (
    PostureChain,
    PostureMove,
    RestingState,
    are_near,
    sample_moves,
)
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot, TorqueLimit
from robots.body.lengths import leg_length
from robots.quaternion import Array

ROUGH = Disturbance(ground_friction=Uniform(0.6, 1.2), supply=Uniform(0.95, 1.05))
"""What a move has to withstand, beside `JOINT_NOISE`: all worlds must come to rest alike."""
JOINT_NOISE = Normal(0.015)  # rad, at the start of a move
OP3_LEG = 0.22  # m; times scale with the root of a leg's length
SETTLING = 0.35  # s for OP3, the rest after each move
REST_TIME = 0.06  # s at the end of a move over which a robot's speed is measured
REST_JOINT_SPEED, REST_ROOT_SPEED = 0.6, 0.06  # rad/s, and m/s for OP3
MOST_OVERLAP = 0.008  # m by which a robot may press into itself
FINER = 2  # physics steps a control period of a check in the undisturbed world
STANDS = -1
"""Of a chain that ends in a held stand."""
MISSES = 3  # disturbed worlds of eight in which a chain that is kept may fall
BEHIND = 0.05  # progress by which a robot may be behind one that is alike

Bools = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrivals:
    """Where M moves end, in K worlds each."""

    qpos: Array
    """MuJoCo positions, (M, K, nq)."""
    features: Features
    """Of all robots, (M * K,)."""
    rests: Bools
    """Which robots rest, (M, K)."""
    stands: Bools
    """Which ones are upright on their feet, (M, K)."""

    def are_like(self, states: Sequence[RestingState]) -> Bools:
        """Tell which moves end in all worlds like their state, (M,): near, and not behind."""
        shape = self.rests.shape
        cells = np.array([state.cell for state in states])
        progress = np.array([state.progress for state in states])
        own = self.features.cells.reshape(*shape, -1)
        near = are_near(own, cells[:, None])
        kept = self.features.progress.reshape(shape) >= progress[:, None] - BEHIND
        return np.all(self.rests & near & kept, axis=1)

    def join(self, others: Arrivals) -> Arrivals:
        """Join the ends of the same moves in further worlds."""
        return Arrivals(
            qpos=np.concatenate([self.qpos, others.qpos], axis=1),
            features=self.features.join(others.features, len(self.qpos)),
            rests=np.concatenate([self.rests, others.rests], axis=1),
            stands=np.concatenate([self.stands, others.stands], axis=1),
        )

    def state(self, row: int, target: Array, **fields: Any) -> RestingState:
        """Return the state in the first world, with the targets that are held there (n,)."""
        first = row * self.rests.shape[1]
        return make_state(self.qpos[row, 0], target, self.features, first, **fields)


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


def make_state(
    qpos: Array, target: Array, features: Features, row: int, **fields: Any
) -> RestingState:
    """Make a state at MuJoCo positions (nq,) from one row of features."""
    return RestingState(
        qpos=qpos.copy(),
        target=target,
        cell=tuple(features.cells[row].tolist()),
        progress=float(features.progress[row]),
        place=features.places[row],
        **fields,
    )


class MovePlayer:
    """Plays moves in one world: roughly to try them, disturbed to check them.

    A trial simulates one physics step a control period, which is enough to tell which moves are
    worth a check; a check simulates the undisturbed world in finer steps. A whole chain is
    judged by a held stand, undisturbed in the world's own steps, disturbed in those of a check.
    """

    def __init__(
        self,
        world: World,
        meter: Meter,
        rng: np.random.Generator,
        *,
        limit: TorqueLimit = FULL_TORQUE,
        weakest: float = 1.0,
        threads: int = 0,
    ) -> None:
        """Prepare for a world, for what is measured, and for a torque limit of every servo.

        In every other disturbed world, ``weakest`` is the share of that limit that is left.
        """
        self.world, self._rng, self._limit, self._weakest = world, rng, limit, weakest
        period = world.robot.control_period
        self._trial = Experiment(world.vary(timestep=period), threads=threads)
        self._experiment = Experiment(world, threads=threads)
        self._finer = Experiment(world.vary(timestep=period / FINER), threads=threads)
        self._layout = world.robot.layout(world.model)
        self._meter = meter
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
        tried, new = self.try_out(states, moves), list[RestingState]()
        for k in np.flatnonzero(tried.rests[:, 0]).tolist():
            fields = {"before": states[k], "move": moves[k], "depth": states[k].depth + 1}
            state = tried.state(k, moves[k].target, **fields)
            if tried.stands[k, 0] or archive.wants(state):
                new.append(state)
        return new

    def check(
        self, states: Sequence[RestingState], moves: Sequence[PostureMove], worlds: int
    ) -> Arrivals:
        """Play a move from each of M states in K worlds, the first undisturbed."""
        targets = self._sample(states, [[move] for move in moves])
        first = self._arrive(self._finer, self._make_nominal(states), targets)
        if worlds == 1:
            return first
        return first.join(self._arrive(self._trial, self._disturb(states, worlds - 1), targets))

    def repeat_last(
        self, states: Sequence[RestingState], worlds: int
    ) -> tuple[Arrivals, list[RestingState]]:
        """Check the last moves of M states in K worlds; return their ends, and states as there."""
        begun = [state.before for state in states if state.before is not None]
        moves = [state.move for state in states if state.move is not None]
        ends = self.check(begun, moves, worlds)
        return ends, [replace(one, qpos=ends.qpos[k, 0].copy()) for k, one in enumerate(states)]

    def are_near(self, state: RestingState, qpos: Array) -> bool:
        """Tell whether robots at MuJoCo positions (K, nq) are all near to a state."""
        return bool(np.all(are_near(self._meter.measure(qpos).cells, state.cell)))

    def repeat(self, states: Sequence[RestingState], scenarios: Scenarios) -> Bools:
        """Tell which of M states that are one move from the start are reached in most scenarios."""
        begun = [state.before for state in states if state.before is not None]
        moves = [[state.move] for state in states if state.move is not None]
        tiled = scenarios.tile(len(states))
        ends = self._arrive(self._trial, tiled, self._sample(begun, moves))
        cells = np.array([state.cell for state in states])[:, None]
        near = are_near(ends.features.cells.reshape(len(states), len(scenarios), -1), cells)
        return np.sum(~near, axis=1) <= MISSES

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
        """Play M whole chains in K scenarios of their start.

        Args:
            ends: Stands at the ends of M chains from one start.
            scenarios: The first is undisturbed, and played in the world's own physics steps.
        """
        paths = [end.path for end in ends]
        targets = self._sample([path[0] for path in paths], [end.chain.moves for end in ends])
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
            found.lost[k] = self._find_missed(paths[int(k)], record.qpos[rows], misses)
        return found

    def _find_missed(self, path: list[RestingState], qpos: Array, misses: int) -> int:
        """Find the first state of a path that too many of K worlds have missed, (K, T, nq)."""
        period, at = self.world.robot.control_period, 0
        for number, state in enumerate(path[1:-1], start=1):
            assert state.move is not None
            at += len(state.move.sample(state.target, period, self.rest))
            cells = self._meter.measure(qpos[:, min(at, qpos.shape[1]) - 1]).cells
            if np.sum(~are_near(cells, state.cell)) > misses:
                return number
        return len(path) - 1

    def sample_worlds(self, start: Array, worlds: int) -> Scenarios:
        """Sample the worlds in which whole chains are played; the first is undisturbed.

        They start from MuJoCo positions (nq,), and are the same ones for the same start.
        """
        rng = np.random.default_rng(0)
        scenarios = USUAL.sample(self.world, start, worlds, rng, self._limit)
        scenarios.parameters.torque_limit[1::2] *= self._weakest
        return scenarios

    def _make_nominal(self, states: Sequence[RestingState]) -> Scenarios:
        starts = np.array([state.qpos for state in states])
        return Scenarios.nominal(self.world, starts, self._limit)

    def _disturb(self, states: Sequence[RestingState], worlds: int) -> Scenarios:
        """Make disturbed scenarios from M states, K of each, (M * K,)."""
        starts = np.repeat([state.qpos for state in states], worlds, axis=0)
        parameters = ROUGH.draw(self.world, len(starts), self._rng, self._limit)
        parameters.torque_limit.reshape(-1, worlds)[:, ::2] *= self._weakest
        noise = JOINT_NOISE.draw(self._rng, len(starts), self.world.robot.n)
        starts[:, self._layout.qpos] += noise
        return Scenarios(starts=starts, parameters=parameters)

    def _arrive(self, experiment: Experiment, scenarios: Scenarios, targets: Array) -> Arrivals:
        """Play targets (M, T, n) in scenarios (M * K,); measure where robots end."""
        each = len(scenarios) // len(targets)
        record = experiment.play(scenarios, np.repeat(targets, each, axis=0))
        self.simulated += record.duration
        ends = record.qpos[:, -1]
        return Arrivals(
            qpos=ends.reshape(-1, each, ends.shape[1]),
            features=self._meter.measure(ends),
            rests=self._find_resting(record, scenarios.parameters.voltage).reshape(-1, each),
            stands=record.upright[:, -self._rest_steps :].all(axis=1).reshape(-1, each),
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

    def _find_resting(self, record: Record, voltage: Array) -> Bools:
        """Tell which robots are at rest at the end, and never pressed into themselves, (N,).

        No servo may be saturated at the supply [V], (N,), as its robot rests: it would trip in a
        row of such postures.
        """
        steps, root = self._rest_steps, record.qpos[:, :, self._layout.root_position]
        turned = np.abs(record.joint_pos[:, -1] - record.joint_pos[:, -1 - steps]).max(axis=1)
        moved = np.linalg.norm(root[:, -1] - root[:, -1 - steps], axis=1)
        time = steps * record.period
        slow = (turned < REST_JOINT_SPEED * time) & (moved < REST_ROOT_SPEED * self.scale * time)
        torque, velocity = record.torque[:, -steps:], record.actuator_vel[:, -steps:]
        saturated = find_saturation(self.world.robot, torque, velocity, voltage[:, np.newaxis])
        slow &= ~np.any(np.all(saturated, axis=1), axis=1)
        if record.overlap is not None:
            slow &= record.overlap.max(axis=1) < MOST_OVERLAP
        return slow & ~record.diverged
