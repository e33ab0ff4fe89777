"""Settings of a planner: the limits that it keeps, and what it prefers and leaves out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from humanoid_getup.motions.preference import Preference, PreferenceName
from robots import FULL_TORQUE, TorqueLimit
from robots.arguments import expect

MOST_BUDGET = 1e6


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """Settings of a planner and its simulation; the defaults are the best known."""

    torque_limit: TorqueLimit = FULL_TORQUE
    """Torque limit of every servo."""
    prefer: PreferenceName = "time"
    """Secondary objective of a rise."""
    search_budget: float = 600.0
    """Simulated time in which a search may vary a rollout's targets [s]."""
    planning: bool = True
    """Plan a path to the connecting posture; False: interpolate straight to it."""
    filtering: bool = True
    """Filter through physics; False: path and motion are played as they are."""
    threads: int = 0
    """Threads that step physics; 0 for one per processor. They change no result."""

    def __post_init__(self) -> None:
        expect(
            "torque_limit", self.torque_limit, TorqueLimit, "a TorqueLimit, e.g. TorqueLimit(2.5)"
        )
        Preference.of(self.prefer)
        for name, kind, what in (
            ("search_budget", int | float, "a number of seconds"),
            ("threads", int, "a whole number from 0"),
        ):
            expect(name, getattr(self, name), kind, what)
        for name in ("planning", "filtering"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected True or False")
        if self.threads < 0:
            raise ValueError(f"threads are {self.threads}, expected a whole number from 0")
        if not 0.0 < self.search_budget <= MOST_BUDGET:
            raise ValueError(
                f"search_budget is {self.search_budget} s, expected above 0 s, at most "
                f"{MOST_BUDGET:g} s"
            )

    def describe(self) -> dict[str, Any]:
        """Return the settings that change a result, by their keys in reports."""
        return {
            "torque_limit_nm": self.torque_limit.value,
            "limit_by": self.torque_limit.by,
            "planning": self.planning,
            "filtering": self.filtering,
            "prefer": self.prefer,
            "search_budget_s": self.search_budget,
        }


DEFAULTS = PlannerSettings()
