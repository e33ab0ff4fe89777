"""A collision checker that ends searches: the same budget for every planner."""

from __future__ import annotations

import time
from dataclasses import dataclass

from humanoid_getup.planning.collision import CollisionChecker
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Budget:
    """What a planner may spend on a problem."""

    checks: int = 50_000
    """Postures checked for collisions."""
    time: float = 60.0
    """Wall-clock time [s]: a safety. Where it ends a search, results depend on the machine."""


class BudgetSpentError(Exception):
    """A search has spent its budget."""


class LimitedChecker(CollisionChecker):
    """A collision checker that ends a search when its budget is spent; without one, never."""

    _budget: Budget | None = None
    _before = 0
    _began = 0.0

    def grant(self, budget: Budget | None) -> None:
        """Give the next search a budget, or as much as it wants."""
        self._budget = budget
        self._before, self._began = self.checks, time.perf_counter()

    @property
    def spent(self) -> int:
        """Return how many postures were checked since the last grant."""
        return self.checks - self._before

    def is_free(self, configuration: Array) -> bool:
        """Return whether a posture (7 + n,) collides with nothing.

        Raises:
            BudgetSpentError: if the budget is spent.
        """
        if self._budget is not None:
            late = time.perf_counter() - self._began >= self._budget.time
            if late or self.spent >= self._budget.checks:
                raise BudgetSpentError
        return super().is_free(configuration)
