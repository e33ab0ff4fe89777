"""Resting states, the moves between them, where those arrive, and an archive of the best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from humanoid_getup.posture_chains.features import Features
from robots.quaternion import Array
from robots.smooth_step import smooth_step

Cell = tuple[int, ...]
"""Cell of an archive, in which states that are alike are filed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureMove:
    """Targets that go from posture to posture, then rest."""

    knots: Array
    """Targets after the one held before, (P, n) [rad]."""
    duration: float
    """Time until the last knot [s]."""
    kind: str
    """How it was drawn, such as "limb"."""

    @property
    def target(self) -> Array:
        """Return the targets that are held at the end [rad], (n,)."""
        return self.knots[-1]

    def sample(self, held: Array, period: float, rest: float) -> Array:
        """Sample the targets from those held (n,), and through a rest [s], (T, n)."""
        knots = np.vstack([held, self.knots])
        at = period * np.arange(1.0, round((self.duration + rest) / period) + 1)
        share = smooth_step(at / self.duration) * (len(knots) - 1)
        before = np.minimum(share.astype(int), len(knots) - 2)
        part = (share - before)[:, None]
        return (1.0 - part) * knots[before] + part * knots[before + 1]

    def reverse(self, held: Array) -> PostureMove:
        """Return the move back to the targets held before it, (n,)."""
        return replace(self, knots=np.vstack([self.knots[:-1][::-1], held]), kind="back")


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureChain:
    """Moves from a start, with a rest after each."""

    start: Array
    """MuJoCo positions of the start, at rest, (nq,)."""
    held: Array
    """Targets that are held there [rad], (n,)."""
    moves: tuple[PostureMove, ...]
    fallen: int = 0
    """Disturbed worlds in which it did not end in a held stand."""

    @property
    def duration(self) -> float:
        """Return the time of all moves, without rests [s]."""
        return sum(move.duration for move in self.moves)

    def sample(self, period: float, rest: float) -> Array:
        """Sample the targets, with a rest [s] after each move, (T, n)."""
        return sample_moves(self.held, self.moves, period, rest)

    def list_ends(self, period: float, rest: float) -> list[int]:
        """Count the targets up to the end of each move's rest [s]."""
        counts = [len(move.sample(move.target, period, rest)) for move in self.moves]
        return np.cumsum(counts, dtype=int).tolist()


def sample_moves(held: Array, moves: Sequence[PostureMove], period: float, rest: float) -> Array:
    """Sample the targets of moves from those held (n,), with a rest [s] after each, (T, n)."""
    before = [held, *(move.target for move in moves)]
    sampled = [
        move.sample(target, period, rest) for target, move in zip(before, moves, strict=False)
    ]
    return np.concatenate(sampled)


def are_near(cells: ArrayLike, others: ArrayLike) -> NDArray[np.bool_]:
    """Tell which cells (..., c) are the same or next to each other, (...)."""
    return np.all(np.abs(np.subtract(cells, others)) <= 1, axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class RestingState:
    """A robot at rest, how it came there, or how it gets up from there."""

    qpos: Array
    """MuJoCo positions, (nq,)."""
    target: Array
    """Targets that are held [rad], (n,)."""
    cell: Cell
    progress: float
    """How near it is to a stand, from 0 to 1."""
    place: Array
    """Its place among all states; those that are alike are near to each other, (d,)."""
    arrivals: Array | None = None
    """Where moves from the start have led in K disturbed worlds, (K, nq); None if none have."""
    before: RestingState | None = None
    """Where the move that led here began; None for a start."""
    move: PostureMove | None = None
    """The move that led here."""
    after: RestingState | None = None
    """Where the next move on the way to a stand leads; None if none is known."""
    onward: PostureMove | None = None
    """That move."""
    depth: int = 0
    """Moves since the start or, with a way up, until the stand."""

    def is_near(self, other: RestingState) -> bool:
        """Tell whether another state is in the same cell or the next."""
        return bool(are_near(self.cell, other.cell))

    def list_arrivals(self, worlds: int) -> Array:
        """List where robots are in that many disturbed worlds, (K, nq)."""
        known = self.qpos[None] if self.arrivals is None else self.arrivals
        return known[np.arange(worlds) % len(known)]

    @property
    def path(self) -> list[RestingState]:
        """Return the states from the start to here."""
        states, state = list[RestingState](), self
        while state is not None:
            states.append(state)
            state = state.before
        return states[::-1]

    def leads_through(self, other: RestingState) -> bool:
        """Tell whether another state is on the way from the start to here, or up from here."""
        up: RestingState | None = self
        while up is not None and up is not other:
            up = up.after
        return up is not None or any(state is other for state in self.path)

    @property
    def root(self) -> RestingState:
        """Return the start from which it was reached, or the stance to which its way up leads."""
        state = self
        while state.after is not None:
            state = state.after
        return state.path[0]

    @property
    def chain(self) -> PostureChain:
        """Return the moves from the start to here."""
        first, *others = self.path
        moves = tuple(state.move for state in others if state.move is not None)
        return PostureChain(start=first.qpos, held=first.target, moves=moves)


CLEARLY = 0.02  # by which progress must differ to count
LEAST_WEIGHT = 0.15  # of a state far from the goal, beside 1 of the nearest
LEADERS, LEADING_SHARE = 8, 0.08  # states, and share of all, over whose ranks the weight falls


class Archive:
    """The best resting state of each cell.

    States that are ahead are drawn more often, states that were drawn often less.
    """

    def __init__(self, *, downwards: bool = False) -> None:
        """Begin an archive that leads to a stand, or downwards from it."""
        self._sign = -1.0 if downwards else 1.0
        self._states: dict[Cell, RestingState] = {}
        self._draws: dict[Cell, int] = {}

    def __len__(self) -> int:
        return len(self._states)

    def __iter__(self) -> Iterator[RestingState]:
        return iter(self._states.values())

    def wants(self, state: RestingState) -> bool:
        """Tell whether a state's cell is empty, or has one behind it, or as far but deeper."""
        there = self._states.get(state.cell)
        if there is None:
            return True
        ahead = self._sign * (state.progress - there.progress)
        return ahead > CLEARLY or (ahead > -CLEARLY and state.depth < there.depth)

    def add(self, state: RestingState) -> bool:
        """File a state if it is wanted; tell whether it was."""
        if wanted := self.wants(state):
            self._states[state.cell] = state
            self._draws[state.cell] = 0
        return wanted

    def drop(self, state: RestingState) -> None:
        """Remove a state, and all whose way from the start, or up, leads through it."""
        lost = [cell for cell, other in self._states.items() if other.leads_through(state)]
        root = next(iter(self)).root
        for cell in lost:
            del self._states[cell], self._draws[cell]
        if not self._states:
            self.add(root)

    def draw(self, count: int, rng: np.random.Generator) -> list[RestingState]:
        """Draw states to move on from."""
        states = list(self._states.values())
        weight = self._weigh()
        drawn = [states[int(k)] for k in rng.choice(len(states), count, p=weight / weight.sum())]
        for state in drawn:
            self._draws[state.cell] += 1
        return drawn

    @property
    def draws(self) -> list[int]:
        """Return how often each state was drawn since it was filed."""
        return list(self._draws.values())

    def copy(self) -> Archive:
        """Return an archive of the same states, that grows by itself."""
        other = Archive(downwards=self._sign < 0.0)
        other.restore(list(self), self.draws)
        return other

    def restore(self, states: Sequence[RestingState], draws: Sequence[int]) -> None:
        """Replace all states, in their order, and how often each was drawn."""
        self._states = {state.cell: state for state in states}
        self._draws = {state.cell: n for state, n in zip(states, draws, strict=True)}

    def _weigh(self) -> Array:
        """Weigh states by the rank of their progress and by how often they were drawn."""
        progress = self._sign * np.array([state.progress for state in self])
        rank = np.argsort(np.argsort(-progress, kind="stable"), kind="stable")
        leaders = LEADERS + LEADING_SHARE * len(self)
        draws = np.array(self.draws, dtype=float)
        return (LEAST_WEIGHT + np.exp(-rank / leaders)) / np.sqrt(1.0 + draws)

    @property
    def best(self) -> RestingState:
        """Return the state that is ahead of all."""
        return max(self, key=lambda state: self._sign * state.progress)


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
    presses: Bools
    """Which ones do but for servos that press with all their torque, (M, K)."""
    stands: Bools
    """Which ones are upright on their feet, (M, K)."""

    def are_like(self, states: Sequence[RestingState], *, pressing: bool = False) -> Bools:
        """Tell which moves end in all worlds like their state, (M,): near, and not behind.

        Servos may press with all their torque there if ``pressing``.
        """
        shape = self.rests.shape
        cells = np.array([state.cell for state in states])
        progress = np.array([state.progress for state in states])
        own = self.features.cells.reshape(*shape, -1)
        near = are_near(own, cells[:, None])
        kept = self.features.progress.reshape(shape) >= progress[:, None] - BEHIND
        at_rest = self.rests | self.presses if pressing else self.rests
        return np.all(at_rest & near & kept, axis=1)

    def join(self, others: Arrivals) -> Arrivals:
        """Join the ends of the same moves in further worlds."""
        return Arrivals(
            qpos=np.concatenate([self.qpos, others.qpos], axis=1),
            features=self.features.join(others.features, len(self.qpos)),
            rests=np.concatenate([self.rests, others.rests], axis=1),
            presses=np.concatenate([self.presses, others.presses], axis=1),
            stands=np.concatenate([self.stands, others.stands], axis=1),
        )

    def state(self, row: int, target: Array, **fields: Any) -> RestingState:
        """Return the state in the first world, with the targets that are held there (n,)."""
        first = row * self.rests.shape[1]
        return make_state(self.qpos[row, 0], target, self.features, first, **fields)


@dataclass(frozen=True, kw_only=True, eq=False)
class TriedMove:
    """A move that ended at rest."""

    begun: RestingState
    """Where it began."""
    move: PostureMove
    """The move as it was played."""
    end: RestingState
    """Where it ended, by itself."""
    stands: bool
    """Whether that is upright on the feet."""


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


def list_resting(
    states: Sequence[RestingState], moves: Sequence[PostureMove], tried: Arrivals
) -> Iterator[TriedMove]:
    """List the moves from M states that ended at rest."""
    for k in np.flatnonzero(tried.rests[:, 0]).tolist():
        yield TriedMove(
            begun=states[k],
            move=moves[k],
            end=tried.state(k, moves[k].target),
            stands=bool(tried.stands[k, 0]),
        )
