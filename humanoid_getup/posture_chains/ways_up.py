"""Ways up: resting states from which a chain of moves to a stand is known; and their torque."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy  # which imports its parts when they are used
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.move_player import MovePlayer, measure_time_scale
from humanoid_getup.posture_chains.moves import DURATIONS, BalancedPostures, RandomMoves
from humanoid_getup.posture_chains.resting_state import (
    Archive,
    PostureMove,
    RestingState,
    sample_moves,
)
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.body.squats import DEEP_ENOUGH
from robots.kinematics import place
from robots.quaternion import Array
from robots.smooth_step import invert_smooth_step

WORLDS = 3  # in which a way up must lead on, the first undisturbed
HOLDING = 0.3  # s for OP3 in which a squat comes to rest
SQUAT_TIME = 1.6  # s for OP3 from a squat to the stance
ROUNDS, FURTHER = 8, 16
"""In which the nearest pairs of crouches, or props, and ways up are tried, and in which those of
cells without a way up are."""
TARGET_WEIGHT = 0.35  # of targets [rad RMS] beside the places of states
DEPTH_COST = 0.03  # of a move, in the same unit
ENTRIES = 4  # frames of a stored motion that are filed
KNOT_TIME = 0.1  # s between the targets that are taken from it
FARTHEST = 1.2  # distance over which states are paired

Pair = tuple[RestingState, RestingState]
"""A state of a search, and one with a way up."""


class WaysUp:
    """Finds ways up from the stance downwards: a move away is kept if the move back leads back."""

    def __init__(
        self,
        player: MovePlayer,
        moves: RandomMoves,
        rng: np.random.Generator,
        known: Sequence[RestingState] = (),
    ) -> None:
        """Begin with the goal, and balanced postures from which it is reached.

        Where states with a way up are ``known``, they take their place.
        """
        self._player, self._moves = player, moves
        self.goal = player.describe(player.goal.qpos, player.goal.target)
        self.archive = Archive(downwards=True)
        self.archive.add(self.goal)
        self.paired: set[Pair] = set()
        """Pairs whose connection was tried."""
        self.are_stored = bool(known)
        """Whether they were known from the beginning."""
        if known:
            self.archive.restore(known, [0] * len(known))
            self.goal = known[0].root
            return
        if player.goal.is_stand:
            self._add_squats()
        self._add_balanced(rng)

    def __iter__(self) -> Iterator[RestingState]:
        return iter(self.archive)

    def __len__(self) -> int:
        return len(self.archive)

    def copy(self, player: MovePlayer) -> WaysUp:
        """Return the same ways up, that grow by themselves with another player's moves."""
        other = copy.copy(self)
        other._player = player
        other.archive, other.paired = self.archive.copy(), {*self.paired}
        return other

    def advance(self, count: int, rng: np.random.Generator) -> None:
        """Try a number of moves from states with a way up, and file where they lead."""
        states = self.archive.draw(count, rng)
        moves = self._moves.draw_all(states, self._player.scale, rng)
        new = list[RestingState]()
        for tried in self._player.try_softly(states, moves):
            up, back = tried.begun, tried.move.reverse(tried.begun.target)
            state = replace(tried.end, after=up, onward=back, depth=up.depth + 1)
            if self.archive.wants(state):
                new.append(state)
        self._check(new)

    def add_motions(self, motions: Sequence[Motion], count: int) -> None:
        """File entry frames of motions that rise, from which what follows leads to the stance.

        Whether it does is tried and checked, a number at a time, under this search's torque limit.
        """
        robot, model = self._player.world.robot, self._player.world.model
        entries, onward = list[RestingState](), list[PostureMove]()
        for motion in motions:
            frames = motion.entry_frames
            chosen = np.linspace(0, len(frames) - 1, min(ENTRIES, len(frames)))
            for frame in frames[chosen.round().astype(int)]:
                posture = motion.posture(int(frame))
                entries.append(
                    self._player.describe(place(robot, model, posture), posture.joint_pos)
                )
                onward.append(_follow(motion, int(frame), self.goal.target))
        order = np.argsort([move.duration for move in onward], kind="stable")
        for first in range(0, len(order), count):
            rows = order[first : first + count]
            states, moves = [entries[k] for k in rows], [onward[k] for k in rows]
            self._check(self._try_onward(states, moves, [self.goal] * len(rows)))

    def _try_onward(
        self, states: list[RestingState], onward: list[PostureMove], ups: list[RestingState]
    ) -> list[RestingState]:
        """Try a move from each state to one with a way up; return those that lead there."""
        leads = self._player.try_out(states, onward).are_like(ups, pressing=True)
        return [
            replace(states[k], after=ups[k], onward=onward[k], depth=ups[k].depth + 1)
            for k in np.flatnonzero(leads)
        ]

    def add_chain(self, last: RestingState, first: int = 0) -> None:
        """File the states of a chain to a stand, from one of its path on: each has a way up."""
        after = self.goal
        for state in last.path[:first:-1]:
            if state.before is None:
                return
            after = replace(
                state.before,
                arrivals=None,
                before=None,
                move=None,
                after=after,
                onward=state.move,
                depth=after.depth + 1,
            )
            self.archive.add(after)

    def drop(self, state: RestingState, steps: int) -> None:
        """Remove the state some steps up from one, whose next move has failed.

        Those that lead to the stance itself stay: nearly all ways up go through them.
        """
        lost: RestingState | None = state
        for _ in range(steps):
            lost = lost.after if lost is not None else None
        if lost is not None and lost.depth > 1:
            self.archive.drop(lost)

    def pair(self, states: list[RestingState], most: int) -> list[Pair]:
        """Pair states with near ones that have a way up, each pair once, the nearest first."""
        ups, pairs = list(self), []
        distance = scipy.spatial.distance.cdist(_locate(states), _locate(ups))
        distance += DEPTH_COST * np.array([up.depth for up in ups])
        for k in np.argsort(distance, axis=None, kind="stable"):
            i, j = np.unravel_index(k, distance.shape)
            if distance[i, j] > FARTHEST or len(pairs) == most:
                break
            pair = states[i], ups[j]
            if pair not in self.paired:
                self.paired.add(pair)
                pairs.append(pair)
        return pairs

    def aim(
        self,
        state: RestingState,
        up: RestingState,
        rng: np.random.Generator,
        times: Sequence[float] = DURATIONS,
    ) -> PostureMove:
        """Make the move to the targets of a state with a way up, in one of OP3's times [s]."""
        drawn = float(rng.choice(times)) * self._player.scale
        return self._moves.aim(state.target, up.target, drawn, "connect")

    def _add_balanced(self, rng: np.random.Generator) -> None:
        """File crouches and props that hold, and from which a move leads to a known way up."""
        waiting = [*self._hold(self._moves.crouches), *self._hold(self._moves.props)]
        for number in range(ROUNDS + FURTHER):
            waiting = [state for state in waiting if self.archive.wants(state)]
            if number >= ROUNDS:
                known = {state.cell for state in self.archive}
                waiting = [state for state in waiting if state.cell not in known]
            deepest = sorted(waiting, key=lambda state: -state.progress)
            of_cells = [*{state.cell: state for state in deepest}.values()]
            pairs = self.pair(of_cells, len(of_cells)) if of_cells else []
            if not pairs:
                return
            onward = [self.aim(state, up, rng) for state, up in pairs]
            states, ups = [state for state, _ in pairs], [up for _, up in pairs]
            self._check(self._try_onward(states, onward, ups))

    def _hold(self, balanced: BalancedPostures) -> list[RestingState]:
        """Hold postures on their soles; return the states of those that rest."""
        robot, model, targets = self._player.world.robot, self._player.world.model, balanced.targets
        placed = [
            self._player.describe(place(robot, model, posture), target)
            for posture, target in zip(balanced.postures, targets, strict=True)
        ]
        if not placed:
            return []
        time = HOLDING * self._player.scale
        holds = [PostureMove(knots=each[None], duration=time, kind="hold") for each in targets]
        held = self._player.try_out(placed, holds)
        return [held.state(int(k), targets[k]) for k in np.flatnonzero(held.rests[:, 0])]

    def _add_squats(self) -> None:
        """File the balanced squats that hold, and from which higher ones lead to the stance."""
        squats, new = self._moves.squats, list[RestingState]()
        for state in self._hold(squats):
            k = int(np.flatnonzero((squats.targets == state.target).all(axis=1))[0])
            onward = self._moves.rise(squats.targets[:k], SQUAT_TIME * self._player.scale)
            new.append(replace(state, after=self.goal, onward=onward, depth=1))
        self._check(new)

    def _check(self, states: list[RestingState]) -> None:
        """File states whose next move leads where it should in all worlds."""
        if not states:
            return
        onward = [state.onward for state in states if state.onward is not None]
        goals = [state.after for state in states if state.after is not None]
        led = self._player.lead(states, onward, goals, WORLDS)
        for state, move in zip(states, led, strict=True):
            if move is not None:
                self.archive.add(replace(state, onward=move))


def _follow(motion: Motion, frame: int, stance: Array) -> PostureMove:
    """Make the move along a motion from one of its frames to the stance (n,)."""
    begins = float(motion.time[frame])
    duration = max(float(motion.time[-1]) - begins, KNOT_TIME)
    count = math.ceil(duration / KNOT_TIME)
    share = invert_smooth_step(np.linspace(0.0, 1.0, count + 1)[1:])
    knots = motion.sample(begins + duration * share)
    knots[-1] = stance
    return PostureMove(knots=knots, duration=duration, kind="motion")


def _locate(states: list[RestingState]) -> Array:
    """Locate states by their features and the RMS of their targets, (K, d)."""
    weight = TARGET_WEIGHT / np.sqrt(len(states[0].target))
    return np.array([[*state.place, *(weight * state.target)] for state in states])


FACTORS = (1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0, 300.0)
"""On the servos' torque, tried in this order."""
MOST_SQUATS = 2 / 3  # of the squats from which a robot rises with all its torque
AT_LIMIT = 0.9  # share of a limit from which a servo is at it: registers round small ones down
STRAINED = 0.05  # share of the time below which the limit of a servo is not what a rise fails by


@dataclass(frozen=True, kw_only=True)
class Lifting:
    """What keeps a robot from rising out of a squat."""

    neck: float
    """Height of the neck in the squat, as a share of that of the stance."""
    joint: str
    """The joint whose servo is at its limit longest."""
    at_limit: float
    """Share of the time for which it is."""
    torque: float
    """That limit [N·m]."""
    factor: float
    """Least factor on all torques with which the robot rises."""

    def describe(self) -> str:
        """Describe it in one line."""
        return (
            f"the servos do not lift the robot out of a squat with its neck at {self.neck:.0%}: "
            f"joint '{self.joint}' is at its limit of {self.torque:.3g} N·m for "
            f"{self.at_limit:.0%} of the time; with {self.factor:g} times the torque, "
            f"{self.factor * self.torque:.3g} N·m, it rises"
        )


def find_least_share(
    world: World, moves: RandomMoves, limit: TorqueLimit, shares: Sequence[float]
) -> float:
    """Find the first share of a torque limit with which a robot rises from most of its squats.

    Those are `MOST_SQUATS` of the squats from which it does under the limit; 1 if no share is
    enough.
    """
    able = find_rises(world, moves, limit)
    for share in shares:
        if able.any() and find_rises(world, moves, limit, share)[able].mean() >= MOST_SQUATS:
            return share
    return 1.0


def find_rises(
    world: World, moves: RandomMoves, limit: TorqueLimit, share: float = 1.0
) -> NDArray[np.bool_]:
    """Find from which squats a robot rises with a share of a torque limit, undisturbed, (Q,)."""
    if not len(moves.squats):
        return np.zeros(0, dtype=bool)
    rises = [_Rise(world, moves, squat) for squat in range(len(moves.squats))]
    scenarios = Scenarios.nominal(world, np.array([rise.start for rise in rises]), limit)
    scenarios.parameters.torque_limit[:] *= share
    targets = [rise.targets for rise in rises]
    return Outcome(Experiment(world).play(scenarios, targets, stop_early=True), world.robot).stood


def check_lifting(world: World, moves: RandomMoves, limit: TorqueLimit) -> Lifting | None:
    """Let a robot rise from a deep squat; None if it does, or does not for want of balance."""
    deep = np.flatnonzero(moves.squat_necks <= DEEP_ENOUGH)
    if not deep.size:
        return None
    rise = _Rise(world, moves, int(deep[0]))
    outcome = rise.play(limit, 1.0)
    if outcome.stood[0]:
        return None
    joint, at_limit, torque = _find_strained(world, outcome, limit)
    if at_limit < STRAINED:
        return None
    factor = next((factor for factor in FACTORS if rise.play(limit, factor).stood[0]), None)
    if factor is None:
        return None
    neck = float(moves.squat_necks[deep[0]])
    return Lifting(neck=neck, joint=joint, at_limit=at_limit, torque=torque, factor=factor)


class _Rise:
    """The rise from one squat through the higher ones."""

    def __init__(self, world: World, moves: RandomMoves, squat: int) -> None:
        self._world, robot, targets = world, world.robot, moves.squats.targets
        scale = measure_time_scale(robot)
        self.start = place(robot, world.model, moves.squats.postures[squat])
        way = [
            PostureMove(knots=targets[squat][None], duration=HOLDING * scale, kind="hold"),
            moves.rise(targets[:squat], SQUAT_TIME * scale),
        ]
        self.targets = sample_moves(targets[squat], way, robot.control_period, HOLDING * scale)

    def play(self, limit: TorqueLimit, factor: float) -> Outcome:
        world = self._world
        scenarios = Scenarios.nominal(world, self.start, limit)
        scenarios.parameters.torque_limit[:] *= factor
        beyond = np.max(scenarios.parameters.torque_limit) / float(world.robot.max_torque.max())
        scenarios.parameters.strength[:] *= max(beyond, 1.0)  # only above what the servos have
        record = Experiment(world, threads=1).play(scenarios, [self.targets], stop_early=True)
        return Outcome(record, world.robot)


def _find_strained(world: World, outcome: Outcome, limit: TorqueLimit) -> tuple[str, float, float]:
    """Find the joint whose servo is at its limit longest, the share of the time, and the limit."""
    robot = world.robot
    full = robot.find_stall(robot.supply_voltage)
    most: Array = full if limit.value is None else np.minimum(full, limit.value)
    torque = np.abs(outcome.record.torque[0, : outcome.record.cycles[0]])
    at_limit = np.mean(torque >= AT_LIMIT * most, axis=0)
    worst = int(np.argmax(at_limit))
    return robot.joint_names[worst], float(at_limit[worst]), float(most[worst])
