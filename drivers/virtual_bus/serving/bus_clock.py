"""The time of a virtual bus: physics, devices and scheduled faults go along with it."""

from __future__ import annotations

from collections import deque

from drivers.virtual_bus.serving.fault_injector import Faults
from drivers.virtual_bus.serving.fault_schedule import Schedule
from drivers.virtual_bus.serving.interfaces import Physics


class BusTime:
    """Lets time pass."""

    def __init__(self, body: Physics, faults: Faults, schedule: Schedule | None = None) -> None:
        """Let time pass in a body, and make the faults of a schedule as they come due."""
        self._body, self._faults = body, faults
        self._actions = deque(schedule.plan_actions() if schedule else ())

    @property
    def now(self) -> float:
        """Return the time up to which body and devices went [s]."""
        return self._body.time

    def pass_until(self, to: float) -> None:
        """Let time pass up to a bus time [s], or just before it."""
        while self._actions and self._actions[0][0] <= to:
            at, act = self._actions.popleft()
            self._body.advance(at)
            act(self._faults)
        self._body.advance(to)

    def pass_period(self) -> None:
        """Let one control period pass, then make the faults that came due in it."""
        self._body.pass_period()
        while self._actions and self._actions[0][0] <= self.now:
            self._actions.popleft()[1](self._faults)
