"""Protection of a servo against voltage, heat and overload."""

from __future__ import annotations

import math

from drivers.state import HardwareError
from drivers.virtual_bus.devices.quirks import Quirks
from drivers.virtual_bus.devices.registers import Registers


class Protection:
    """Checks supply, temperature and load against the limits in the registers."""

    def __init__(self, registers: Registers, quirks: Quirks, stall_current: float) -> None:
        """Check a servo whose motor draws a current [A] at standstill, at the nominal supply."""
        self._registers = registers
        self.overload = OverloadModel(stall_current, quirks)
        self.reload()

    def reload(self) -> None:
        """Reload the limits from the registers."""
        registers = self._registers
        self._hottest = registers["temperature_limit"]
        self._lowest = registers["min_voltage_limit"]
        self._highest = registers["max_voltage_limit"]

    def check(self, voltage: float, temperature: float) -> int:
        """Return the `HardwareError` bits for a supply [V] and a temperature [°C]."""
        bits = 0
        if not self._lowest <= round(voltage * 10.0) <= self._highest:
            bits = HardwareError.VOLTAGE.value
        if temperature > self._hottest:
            bits |= HardwareError.OVERHEATING.value
        return bits


class OverloadModel:
    """Heat of a winding, as a share of its steady state at stall.

    A first-order model of current squared: it follows ``(current / stall)²`` with the time
    constant of `Quirks.overload_time` and trips above the square of `Quirks.overload_share`.
    """

    def __init__(self, stall_current: float, quirks: Quirks) -> None:
        self._stall_current = stall_current
        self._limit = quirks.overload_share**2
        self._time = quirks.overload_time
        self.heat = 0.0

    def advance(self, current: float, duration: float) -> bool:
        """Apply a current [A] for a duration [s]; return whether the limit is exceeded."""
        if not self.heat and not current:
            return False
        share = current / self._stall_current
        self.heat += (share * share - self.heat) * -math.expm1(-duration / self._time)
        return self.heat > self._limit
