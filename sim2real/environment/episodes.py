"""The episodes of a training: their age and end, and the curricula that follow how they ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

# s; the stored motions rise in 1.6 to 4.6 s, so there is time for a second try and a stand.
LONGEST = 6.0
# s of standing that count as success: half of what a judge requires, since exploration noise
# disturbs a stand that would be held.
HELD = 1.5
ALONE = 0.05  # of the weight; a robot with less assistive force gets up by itself


@dataclass(frozen=True)
class EndedEpisodes:
    """How episodes ended."""

    ended: NDArray[np.int_]
    """Robots whose episode is over."""
    from_pool: NDArray[np.int_]
    """Those that began in the pool."""
    starts: NDArray[np.int_]
    """Row in the pool of each of these."""
    stood: NDArray[np.bool_]
    """Whether each of these ended standing."""
    alone: NDArray[np.bool_]
    """Whether each of these had hardly any assistive force."""


@dataclass(eq=False)
class Episodes:
    """State of the episodes of N robots; all times are policy steps."""

    age: NDArray[np.int_]
    """Policy steps so far, (N,)."""
    length: NDArray[np.int_]
    """Policy steps at most, (N,)."""
    held: NDArray[np.int_]
    """Policy steps of uninterrupted standing, (N,)."""
    start: NDArray[np.int_]
    """Row in the pool; -1 for other initial states, (N,)."""
    ends_early: NDArray[np.bool_]
    """Whether an episode ends once its robot has stood, (N,)."""
    alone: NDArray[np.bool_]
    """Whether the assistive force is less than ``ALONE`` of the robot's weight, (N,)."""

    @staticmethod
    def of(n: int, longest: int) -> Episodes:
        """Make unstarted episodes of a length."""
        return Episodes(
            age=np.zeros(n, dtype=int),
            length=np.full(n, longest),
            held=np.zeros(n, dtype=int),
            start=np.full(n, -1),
            ends_early=np.zeros(n, dtype=bool),
            alone=np.ones(n, dtype=bool),
        )

    def begin(
        self,
        ids: NDArray[np.int_],
        start: NDArray[np.int_],
        ends_early: NDArray[np.bool_],
        force: Array,
    ) -> None:
        """Start new episodes of some robots, under an assistive force as a share of the weight."""
        self.restart(ids)
        self.start[ids], self.ends_early[ids] = start, ends_early
        self.alone[ids] = force < ALONE

    def restart(self, ids: NDArray[np.int_]) -> None:
        """Start episodes from where the last ones ended."""
        self.age[ids] = self.held[ids] = 0

    def limit(self, ids: NDArray[np.int_], steps: Array) -> None:
        """Set the length of some episodes."""
        self.length[ids] = np.ceil(steps)

    def advance(
        self,
        standing: NDArray[np.bool_],
        terminated: NDArray[np.bool_],
        diverged: NDArray[np.bool_],
        held: int,
    ) -> EndedEpisodes:
        """Advance all episodes by a policy step; find those that are over, from masks (N,).

        A robot that has stood for ``held`` policy steps has succeeded.
        """
        self.age += 1
        self.held = np.where(standing, self.held + 1, 0)
        stood = (self.held >= held) & ~diverged
        is_over = (self.age >= self.length) | (stood & self.ends_early) | diverged | terminated
        ended = np.flatnonzero(is_over)
        from_pool = ended[self.start[ended] >= 0]
        return EndedEpisodes(
            ended, from_pool, self.start[from_pool], stood[from_pool], self.alone[from_pool]
        )


# Hard falls are drawn more often: a success rate of 0.45 means more than half of all falls.
FORCE_EPISODES, FORCE_SUCCESS, FORCE_STEP = 200, 0.45, 0.05


@dataclass(eq=False)
class AssistiveForce:
    """Upper limit of the force that lifts robots; field names are those of the checkpoint."""

    lift: float
    """Upper limit, as a fraction of the weight."""
    first: float
    """Initial upper limit."""
    ended: int = 0
    stood: int = 0

    @property
    def cost_share(self) -> float:
        """Return the factor on costs: it grows from 0 to 1 as the force fades."""
        return 1.0 - self.lift / self.first if self.first else 1.0

    def note(self, stood: NDArray[np.bool_]) -> None:
        """Count episodes; reduce the force after enough of them if most ended in a stand."""
        self.ended += len(stood)
        self.stood += int(stood.sum())
        if self.ended < FORCE_EPISODES:
            return
        if self.stood > FORCE_SUCCESS * self.ended:
            self.lift = max(self.lift - FORCE_STEP, 0.0)
        self.ended = self.stood = 0


TO_OPEN = 200  # successes in a level that open the next


class LevelCurriculum:
    """Opens the levels of initial states one by one, easy ones first."""

    def __init__(self, levels: NDArray[np.int_]) -> None:
        """Begin with level 0 of starts at these levels, (P,)."""
        self._levels = levels
        self.open = 0
        """Highest level that is open."""
        self.successes = 0
        """In the highest open level."""

    def note(self, starts: NDArray[np.int_], stood: NDArray[np.bool_]) -> None:
        """Count the successes of episodes from some starts; open the next level after enough."""
        self.successes += int(np.sum(stood & (self._levels[starts] == self.open)))
        if self.successes >= TO_OPEN and self.open < self._levels.max():
            self.open, self.successes = self.open + 1, 0

    def save_state(self) -> dict[str, int]:
        """Return the complete state, for :meth:`restore_state`."""
        return {"open": self.open, "successes": self.successes}

    def restore_state(self, state: dict[str, int]) -> None:
        """Restore a state of :meth:`save_state`."""
        self.open, self.successes = state["open"], state["successes"]
