"""What a bus asks of the physics behind its devices."""

from __future__ import annotations

from typing import Protocol

from drivers.virtual_bus.devices.chain import Chain


class Physics(Protocol):
    """The physics behind the devices."""

    time: float
    """Bus time that it has reached [s]."""
    is_light: bool
    """Whether it computes next to nothing, so that its thread may go before all others."""

    def advance(self, to: float) -> None:
        """Advance physics and devices to a bus time [s], or to the last step before it."""

    def pass_period(self) -> None:
        """Advance by one control period."""

    def heat(self, servo_id: int, temperature: float) -> None:
        """Set the temperature of a servo [°C]."""

    def sag(self, voltage: float) -> None:
        """Set the supply voltage [V]."""


class StillPhysics(Physics):
    """No physics: the devices do not move, and only their clocks advance."""

    is_light = True

    def __init__(self, devices: Chain, period: float = 0.008) -> None:
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

    def heat(self, servo_id: int, temperature: float) -> None:
        """Refuse: there is no temperature to set."""
        raise NotImplementedError("a bus without physics has no temperature to change")

    def sag(self, voltage: float) -> None:
        """Refuse: there is no supply to set."""
        raise NotImplementedError("a bus without physics has no supply to change")
