"""Selects a strategy, planned or learned, by its track record."""

from __future__ import annotations

import numpy as np

from humanoid_getup.experiments.starts.falls import classify
from humanoid_getup.strategies.plan import RisePlan, Strategy
from humanoid_getup.strategies.track_record import StrategyId, TrackRecord
from robots import Posture


class StrategySelector:
    """Selects, for each rise, the strategy with the best record for the class of its start.

    Among equals the first is selected, so a default without a record comes first. Starts on no
    side have no record.
    """

    def __init__(self, strategies: dict[StrategyId, Strategy], records: TrackRecord) -> None:
        """Select among strategies for one world and one torque limit."""
        self._strategies, self._records = strategies, records
        default = next(iter(strategies.values()))
        self.world, self.torque_limit = default.world, default.torque_limit

    def select(self, start_class: str | None) -> StrategyId:
        """Select the strategy for a class of starts, ``None`` for no side."""

        def success(strategy: StrategyId) -> float:
            if start_class is None:
                return 0.0
            return self._records.success(strategy, start_class, self.torque_limit)

        return max(self._strategies, key=success)

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise by the selected strategy."""
        return self._strategies[self.select(classify(start.orientation))].plan(start, rng)
