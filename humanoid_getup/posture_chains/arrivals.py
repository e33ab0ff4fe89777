"""Arrivals: where moves from resting states end, and the states that are made of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.posture_chains.features import Features
from humanoid_getup.posture_chains.resting_state import PostureMove, RestingState, are_near
from robots.quaternion import Array

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
