"""What a bus asks of the physics behind its devices."""

from __future__ import annotations

from typing import Protocol


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
