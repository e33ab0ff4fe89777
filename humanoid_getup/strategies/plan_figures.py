"""The figures of a plan, under report.json's keys."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.preference import PreferenceName
from humanoid_getup.strategies.key_record import KeyFigures
from humanoid_getup.style.style_errors import StyleFigures


class RolloutFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A planned rise in its own rollout."""

    stand_time_s: float
    peak_torque_nm: float
    peak_braking_torque_nm: float
    rms_torque_nm: float
    neck_delta_v_m_s: float | None
    self_overlap_m: float | None


@dataclass(frozen=True, kw_only=True)
class PlanFigures(StyleFigures):
    """The figures of a plan; None for those that it does not have."""

    planned: bool
    plan_s: float
    filter_s: float
    rollouts: int
    rounds: int
    robust: float | None
    connection: str | None
    strategy: str | None
    policy: str | None = None
    style: str | None = None
    balanced: bool | None = None
    keys: list[KeyFigures]
    prefer: PreferenceName | None
    search_budget_s: float | None
    searched_s: float | None
    rollout: RolloutFigures | None
    rollout_before_improvement: RolloutFigures | None


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
