"""Record of a search: its preference, its effort and its result."""

from __future__ import annotations

from dataclasses import dataclass

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
