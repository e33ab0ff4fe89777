"""The clock of a virtual bus: advances physics, devices and scheduled faults."""

from __future__ import annotations

from collections import deque

from drivers.virtual_bus.serving.fault_injector import FaultInjector
from drivers.virtual_bus.serving.fault_schedule import FaultSchedule
from drivers.virtual_bus.serving.interfaces import Physics


class BusClock:
    """Advances physics, and injects the faults of a schedule as they come due."""

    def __init__(
        self,
        physics: Physics,
        faults: FaultInjector,
        schedule: FaultSchedule | None = None,
        *,
        advances_time: bool = True,
    ) -> None:
        """Drive physics; without ``advances_time`` another bus of the same robot does."""
        self._physics, self._faults, self._advances_time = physics, faults, advances_time
        self._actions = deque(schedule.plan_actions() if schedule else ())

    @property
    def now(self) -> float:
        """Return the bus time that physics and devices have reached [s]."""
        return self._physics.time

    def pass_until(self, to: float) -> None:
        """Advance to a bus time [s], or to the last physics step before it."""
        if not self._advances_time:
            return
        while self._actions and self._actions[0][0] <= to:
            at, act = self._actions.popleft()
            self._physics.advance(at)
            act(self._faults)
        self._physics.advance(to)

    def pass_period(self) -> None:
        """Advance by one control period, then inject the faults that came due in it."""
        if not self._advances_time:
            return
        self._physics.pass_period()
        while self._actions and self._actions[0][0] <= self.now:
            self._actions.popleft()[1](self._faults)
