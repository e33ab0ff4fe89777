"""Physics of devices that do not move."""

from __future__ import annotations

from typing import Any


class StillPhysics:
    """No physics: only the clocks of some devices advance."""

    is_light = True

    def __init__(self, devices: Any, period: float = 0.008) -> None:
        """Advance the clocks of devices by control periods [s]."""
        self.time, self.period = 0.0, period
        self._devices = devices

    def advance(self, to: float) -> None:
        """Advance the devices to a bus time [s]."""
        self.time = max(self.time, to)
        self._devices.advance(self.time)

    def pass_period(self) -> None:
        """Advance by one control period."""
        self.advance(self.time + self.period)
