"""A search for rises in physics: chains of resting postures from a fall to a stand."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.posture_chains.goal import TIMES, Goal
from humanoid_getup.posture_chains.move_player import STANDS, MovePlayer
from humanoid_getup.posture_chains.moves import DURATIONS, RandomMoves
from humanoid_getup.posture_chains.resting_state import (
    Archive,
    PostureChain,
    PostureMove,
    RestingState,
)
from humanoid_getup.posture_chains.stored_states import load_ways
from humanoid_getup.posture_chains.ways_up import Pair, WaysUp
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit
from robots.quaternion import Array

WORLDS, FEWER_WORLDS = 5, 3
"""In which a new state must be reached, and in a hard search; the first is undisturbed."""
BATCH = 64  # moves that are tried at a time
NEAR_STAND = 0.6  # progress from which rises to the stance, and slow moves, are tried
SLOW_TIMES = (1.6, 3.0)  # s for OP3, of moves to ways up that quick ones do not reach
SLOW_PAIRS = 4  # of a batch, one in so many is tried with such a move
SLOWER = 3.0  # factor on the time of a turn of random moves from states near to a stand
PLAYED = 8  # worlds in which whole chains are played, the first undisturbed
MOST_JUDGED = 16  # chains of a batch that are played whole
TOGETHER = 4  # of these, at once: where one stands undisturbed, no others are played
MOST_CHAINS = 16  # that are kept of each start
ENOUGH = 3  # chains of which no motion was tried, from which longer ones are not played whole
SHORTER = 0.9  # of the time of one that never falls, from which another is worth it
TURNS = ("forward", "downward", "forward", "connect", "slow", "rise")
"""Kinds of batches, in turn."""
TURNS_TO_KNOWN = ("forward", "connect")
"""Those where many ways up are known."""


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """How a search for chains goes about it."""

    batch: int = BATCH
    worlds: int = WORLDS
    limit: TorqueLimit = FULL_TORQUE
    weakest: float = 1.0
    """Share of that limit that is left in every other disturbed world."""
    threads: int = 0
    """Of the simulation; 0 are one per processor. The result does not depend on it."""


class ChainTools:
    """What searches from several starts of one robot share: its simulation, moves and ways up."""

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        settings: SearchSettings | None = None,
        moves: RandomMoves | None = None,
        goal: Goal | None = None,
    ) -> None:
        """Find ways to a goal, by default a stand; make moves if none are given.

        Where ways up are stored for a slope, they are known from the beginning.
        """
        self.settings = settings or SearchSettings()
        self.world, self.rng = world, rng
        self.moves = moves or RandomMoves(world.robot, rng, world.scene.footing)
        self.goal = goal or Goal(world, moves=self.moves)
        self.player = self._make_player()
        known = load_ways(world, self.goal) if self.goal.is_stand else []
        self.ways_up = WaysUp(self.player, self.moves, rng, known)

    def copy(self, rng: np.random.Generator) -> ChainTools:
        """Return tools for another search that begin with what these know."""
        other = copy.copy(self)
        other.rng = rng
        other.player = other._make_player()
        other.ways_up = self.ways_up.copy(other.player)
        return other

    def _make_player(self) -> MovePlayer:
        settings = self.settings
        return MovePlayer(
            self.world,
            self.goal,
            self.rng,
            limit=settings.limit,
            weakest=settings.weakest,
            threads=settings.threads,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ChainEnd:
    """A stand at the end of a chain that is to be played whole."""

    stand: RestingState
    own: int
    """States of its path that are a search's own; those after them are of a way up."""
    up: RestingState | None = None
    """The first of those."""


class ChainSearch:
    """Searches chains of resting postures from one start.

    A state is drawn from an archive, the servos' targets move to a random posture, and where the
    robot rests afterwards, alike in several disturbed worlds, the new state is filed. From the
    other end, ways up lead from the stance downwards; a chain is found where the two meet.
    """

    def __init__(self, tools: ChainTools, start: Array, held: Array | None = None) -> None:
        """Begin at MuJoCo positions (nq,) at rest, by default with their angles as targets (n,)."""
        self._tools, self._player = tools, tools.player
        robot, layout = tools.world.robot, tools.world.robot.layout(tools.world.model)
        held = start[layout.qpos] if held is None else held
        held = np.clip(held, robot.lower, robot.upper)
        self.archive = Archive()
        lying = self._player.describe(start, held)
        disturbed = self._player.sample_worlds(start, PLAYED).take(np.arange(1, PLAYED))
        others = tools.settings.worlds - 1
        self.start = replace(lying, arrivals=self._player.settle(lying, disturbed, others))
        self.archive.add(self.start)
        self.chains: list[PostureChain] = []
        """The best chains found so far: those that fall least, the shortest first."""
        self.untried: list[PostureChain] = []
        """Those of which no motion was tried yet."""
        self.turn = 0
        """Batches so far."""
        self.is_hard = False
        """Whether moves are checked in fewer worlds, as no chain is found."""
        self.risen: set[RestingState] = set()
        """States from which rises to the stance were tried."""

    @property
    def _scenarios(self) -> Scenarios:
        """Sample the worlds in which whole chains are played; each time the same ones."""
        return self._player.sample_worlds(self.start.qpos, PLAYED)

    @property
    def _worlds(self) -> int:
        worlds = self._tools.settings.worlds
        return min(worlds, FEWER_WORLDS) if self.is_hard else worlds

    def advance(self) -> None:
        """Play one batch of moves."""
        turns = TURNS_TO_KNOWN if self._tools.ways_up.are_stored else TURNS
        kind = turns[self.turn % len(turns)]
        self.turn += 1
        count, rng = self._tools.settings.batch, self._tools.rng
        moves, scale = self._tools.moves, self._player.scale
        if kind == "downward":
            self._tools.ways_up.advance(count, rng)
        elif kind == "connect" and (pairs := self._tools.ways_up.pair(list(self.archive), count)):
            self._connect(pairs)
        elif kind == "rise" and (near := self._list_near()):
            self._try(*self._make_rises(near))
        elif kind == "slow" and (near := [s for s in self.archive if s.progress > NEAR_STAND]):
            states = [near[k] for k in rng.integers(len(near), size=count)]
            self._try(states, moves.draw_all(states, SLOWER * scale, rng))
        else:
            states = self.archive.draw(count, rng)
            self._try(states, moves.draw_all(states, scale, rng))

    def shorten(self, chain: PostureChain) -> PostureChain:
        """Return a chain that was found with the shortcuts that its worlds permit."""
        finder = ShortcutFinder(self._player, self._tools.moves, self._tools.settings.worlds)
        return finder.shorten(chain, self._scenarios)

    def _try(self, states: list[RestingState], moves: list[PostureMove]) -> None:
        """Try moves; file where they lead if that is new, and the same in all worlds."""
        self._check(self._player.explore(states, moves, self.archive))

    def _check(self, new: list[RestingState]) -> None:
        if not new:
            return
        ends, checked = self._player.repeat_last(new, self._worlds)
        for k in np.flatnonzero(ends.are_like(new)):
            self.archive.add(checked[k])
        stands = [checked[k] for k in np.flatnonzero(ends.stands.all(axis=1))]
        self._finish([ChainEnd(stand=each, own=len(each.path)) for each in stands])

    def _finish(self, ends: list[ChainEnd]) -> None:
        """Note the shortest chains to stands that lead there from their start, played whole."""
        ends = [end for end in ends if end.stand.chain.duration < self._find_longest()]
        ends = sorted(ends, key=lambda end: end.stand.chain.duration)
        for first in range(0, min(len(ends), MOST_JUDGED), TOGETHER):
            if self._follow(ends[first : first + TOGETHER]).any():
                break
        self.chains = sorted(self.chains, key=_rank)[:MOST_CHAINS]
        self.untried = sorted(self.untried, key=_rank)[:MOST_CHAINS]

    def _follow(self, ends: list[ChainEnd]) -> NDArray[np.bool_]:
        """Play M chains whole, and note those that stand; tell which do undisturbed, (M,)."""
        found = self._player.follow([end.stand for end in ends], self._scenarios)
        for end, number, fallen in zip(ends, found.lost.tolist(), found.fallen, strict=True):
            if number == STANDS:
                self.chains.append(replace(end.stand.chain, fallen=int(fallen)))
                self.untried.append(self.chains[-1])
                self._tools.ways_up.add_chain(end.stand)
            elif number < end.own:
                self._tools.ways_up.add_chain(end.stand, number)
                self.archive.drop(end.stand.path[number])
            elif end.up is not None and number > end.own:
                self._tools.ways_up.drop(end.up, number - end.own - 1)
        return found.stand

    def _find_longest(self) -> float:
        """Return the time that a chain to be played whole may take at most [s]."""
        if len(self.untried) < ENOUGH:
            return np.inf
        if self.untried[0].fallen:
            return max(chain.duration for chain in self.untried)
        return SHORTER * self.untried[0].duration

    def _list_near(self) -> list[RestingState]:
        """List states near to a stand from which no rise was tried yet, the nearest first."""
        near = [s for s in self.archive if s.progress > NEAR_STAND and s not in self.risen]
        each = 2 * len(TIMES) - 1
        near = sorted(near, key=lambda s: -s.progress)[: self._tools.settings.batch // each]
        self.risen |= {*near}
        return near

    def _make_rises(
        self, states: list[RestingState]
    ) -> tuple[list[RestingState], list[PostureMove]]:
        """Make moves straight to the goal."""
        tools, begun, rises = self._tools, list[RestingState](), list[PostureMove]()
        for state in states:
            ways = tools.goal.list_moves(state, tools.moves, self._player.scale)
            begun += [state] * len(ways)
            rises += ways
        return begun, rises

    def _connect(self, pairs: list[Pair]) -> None:
        """Move to the targets of states with a way up; where that leads there, go on up."""
        left = self._link(pairs, DURATIONS)
        if slow := left[: self._tools.settings.batch // SLOW_PAIRS]:
            self._link(slow, SLOW_TIMES)

    def _link(self, pairs: list[Pair], times: Sequence[float]) -> list[Pair]:
        """Link pairs by moves that take one of some times of OP3 [s]; return those left apart."""
        states, ups = [state for state, _ in pairs], [up for _, up in pairs]
        aim, rng = self._tools.ways_up.aim, self._tools.rng
        moves = [aim(state, up, rng, times) for state, up in pairs]
        tried = self._player.try_out(states, moves)
        near, other = list[int](), list[RestingState]()
        for k in np.flatnonzero(tried.rests[:, 0] | tried.presses[:, 0]).tolist():
            fields = {"before": states[k], "move": moves[k], "depth": states[k].depth + 1}
            state = tried.state(k, moves[k].target, **fields)
            if state.is_near(ups[k]):
                near.append(k)
            elif tried.rests[k, 0] and self.archive.wants(state):
                other.append(state)
        self._check(other)
        if near:
            begun, goals = [states[k] for k in near], [ups[k] for k in near]
            led = self._player.lead(begun, [moves[k] for k in near], goals, self._worlds)
            linked = zip(begun, led, goals, strict=True)
            self._finish([_join(s, move, up) for s, move, up in linked if move is not None])
        return [pair for k, pair in enumerate(pairs) if k not in near]


def _rank(chain: PostureChain) -> tuple[int, float]:
    """Rank chains by the worlds in which they fall, then by their time."""
    return chain.fallen, chain.duration


def _join(state: RestingState, move: PostureMove, up: RestingState) -> ChainEnd:
    """Return the stand to which a move to a state with a way up leads, at the end of its chain."""
    last = replace(up, before=state, move=move, depth=state.depth + 1)
    next_up = up
    while next_up.after is not None:
        next_up, onward = next_up.after, next_up.onward
        last = replace(next_up, before=last, move=onward, depth=last.depth + 1)
    return ChainEnd(stand=replace(last, after=None, onward=None), own=len(state.path), up=up)


SHORTCUT_TIME = 0.8  # s for OP3
ATTEMPTS = 3  # at a way on which a whole rise stands

Step = tuple[int, int]
"""From one state of a chain to a later one, by their numbers."""
Edges = dict[Step, PostureMove]


class ShortcutFinder:
    """Finds the quickest way along a chain: single moves are tried, not whole rises."""

    def __init__(self, player: MovePlayer, moves: RandomMoves, worlds: int) -> None:
        """Prepare; a shortcut leads to its posture in some disturbed worlds, as other moves do."""
        self._player, self._moves, self._worlds = player, moves, worlds

    def shorten(self, chain: PostureChain, scenarios: Scenarios) -> PostureChain:
        """Return the quickest chain with shortcuts that stands in scenarios of its start.

        It falls in no more of them than the chain, or in one; without shortcuts, the chain itself.
        """
        states = self._player.trace(chain)
        edges: Edges = {(k, k + 1): move for k, move in enumerate(chain.moves)}
        found = self._find_shortcuts(states)
        for _ in range(ATTEMPTS):
            way = self._find_quickest(len(states), edges | found)
            if not any(step in found for step in way):
                break
            last = _link(states, way, edges | found)
            followed = self._player.follow([last], scenarios)
            missed, fallen = int(followed.lost[0]), int(followed.fallen[0])
            if missed == STANDS and fallen <= max(chain.fallen, 1):
                return replace(last.chain, fallen=fallen)
            led_there = way if missed == STANDS else way[:missed]
            wrong = [step for step in led_there if step in found]
            if not wrong:
                break
            del found[wrong[-1]]
        return chain

    def _find_shortcuts(self, states: list[RestingState]) -> Edges:
        """Find the moves that skip postures, and lead to where the chain does."""
        time, player = SHORTCUT_TIME * self._player.scale, self._player
        pairs = [(i, j) for i, j in combinations(range(len(states)), 2) if j > i + 1]
        direct = {
            (i, j): self._moves.aim(states[i].target, states[j].target, time, "shortcut")
            for i, j in pairs
        }
        for play in (player.try_out, partial(player.check, worlds=self._worlds)):
            if not pairs:
                break
            begun, goals = [states[i] for i, _ in pairs], [states[j] for _, j in pairs]
            leads = play(begun, [direct[pair] for pair in pairs]).are_like(goals)
            pairs = [pair for pair, does in zip(pairs, leads, strict=True) if does]
        return {pair: direct[pair] for pair in pairs}

    def _find_quickest(self, count: int, edges: Edges) -> list[Step]:
        """Find the quickest way from the first state to the last, with a rest after each move."""
        time, before = [0.0] + [np.inf] * (count - 1), [0] * count
        for (i, j), move in sorted(edges.items()):
            arrives = time[i] + move.duration + self._player.rest
            if arrives < time[j]:
                time[j], before[j] = arrives, i
        way, state = list[Step](), count - 1
        while state:
            way.append((before[state], state))
            state = before[state]
        return way[::-1]


def _link(states: list[RestingState], way: list[Step], edges: Edges) -> RestingState:
    """Link states along a way; return the last."""
    last = states[0]
    for depth, step in enumerate(way, start=1):
        last = replace(states[step[1]], before=last, move=edges[step], depth=depth)
    return last
