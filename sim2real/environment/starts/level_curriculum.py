"""A curriculum over levels of initial states.

As in [Frezzato22], section 5.4, a level opens after enough successes in the one before, and all
open ones are visited again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
