"""Resting states, the moves between them, and chains of moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
