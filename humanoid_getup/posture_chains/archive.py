"""An archive of resting states: the best of each cell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from humanoid_getup.posture_chains.resting_state import Cell, RestingState
from robots.quaternion import Array

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
