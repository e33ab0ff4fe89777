"""The choice between a planned rise and a learned one, by what each has shown."""

from __future__ import annotations

import numpy as np

from humanoid_getup.simulation.falls import classify
from humanoid_getup.strategies.plan import RisePlan, Strategy
from humanoid_getup.strategies.track_record import TrackRecord, Way
from robots import Posture, TorqueLimit


class ByRecord:
    """Chooses, each time, the way with the better record for how the robot lies.

    Where none is better, the first is chosen: put what needs no record there. A robot that
    lies on no side has no record.
    """

    def __init__(
        self,
        ways: dict[Way, Strategy],
        records: TrackRecord,
        torque_limit: TorqueLimit,
    ) -> None:
        """Prepare to choose.

        Args:
            ways: Makes plans of each way.
            records: What each way has shown.
            torque_limit: Of the servos.
        """
        self._ways, self._records = ways, records
        self._torque_limit = torque_limit

    def choose(self, start_class: str | None) -> Way:
        """Choose the way for a class of starts; ``None`` for no side."""

        def promise(way: Way) -> float:
            if start_class is None:
                return 0.0
            return self._records.promise(way, start_class, self._torque_limit)

        return max(self._ways, key=promise)

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise the chosen way."""
        return self._ways[self.choose(classify(start.orientation))].plan(start, rng)
