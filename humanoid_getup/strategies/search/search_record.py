"""Record of a search: its preference, its effort and its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.preference import PreferenceName


@dataclass(frozen=True, kw_only=True)
class SearchRecord:
    """Record of the search for a rise."""

    prefer: PreferenceName
    budget: float
    """Simulated time that was permitted [s]."""
    simulated: float = 0.0
    """Simulated time of searches and improvement [s]."""
    outcome: Outcome | None = None
    """Outcome of the rise to play, in its own rollout; None if none stood."""
    before: Outcome | None = None
    """Outcome of the rise before its improvement; None if it was not improved."""

    def record(self) -> dict[str, Any]:
        """Return it under report.json's keys."""
        return {
            "prefer": self.prefer,
            "search_budget_s": self.budget,
            "searched_s": self.simulated,
            "rollout": self.outcome and _encode(self.outcome),
            "rollout_before_improvement": self.before and _encode(self.before),
        }


def _encode(outcome: Outcome) -> dict[str, Any]:
    """Return the figures of a rise's rollout under report.json's keys."""
    figures = outcome.figures()
    return {
        key: figures[key]
        for key in (
            "stand_time_s",
            "peak_torque_nm",
            "peak_braking_torque_nm",
            "rms_torque_nm",
            "neck_delta_v_m_s",
            "self_overlap_m",
        )
    }


NO_SEARCH = {
    "prefer": None,
    "search_budget_s": None,
    "searched_s": None,
    "rollout": None,
    "rollout_before_improvement": None,
}
"""The record of a rise without a search."""
