"""Reads servos again and again without changing anything; notes the range of each position."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.diagnostics import read_items
from drivers.service.servos.loose_servo import LooseServo

SHOWN = 120  # newest positions that are kept for a plot
PRESENT = (
    "operating_mode",
    "torque_enable",
    "hardware_error_status",
    "present_current",
    "present_load",
    "present_velocity",
    "present_position",
    "present_input_voltage",
    "present_temperature",
)


@dataclass
class Gauge:
    """What was read of a servo."""

    servo: LooseServo
    values: dict[str, int] = field(default_factory=dict)
    """Newest values of its registers, in counts; empty before the first reply."""
    lowest: int | None = None
    """Lowest position so far [ticks]; None before the first reply."""
    highest: int | None = None
    missed: int = 0
    """Reads without a reply since the last one."""
    positions: deque[int] = field(default_factory=lambda: deque(maxlen=SHOWN))
    """Newest positions [ticks]."""

    @property
    def errors(self) -> int:
        """Return its hardware errors, as bits of `HardwareError`."""
        return self.servo.table.name_errors(self.values.get("hardware_error_status", 0))

    def to_si(self, register: str) -> float | None:
        """Return a register's newest value in its unit; None if it has none."""
        if register not in self.values:
            return None
        return self.servo.table.to_si(register, self.values[register])

    def note(self, values: dict[str, int]) -> None:
        """Note what was read, in counts."""
        position = values["present_position"]
        self.values, self.missed = values, 0
        self.positions.append(position)
        self.lowest = position if self.lowest is None else min(self.lowest, position)
        self.highest = position if self.highest is None else max(self.highest, position)

    @property
    def angle(self) -> float | None:
        """Return its angle from the middle of its turn [rad]; None before the first reply."""
        if not self.positions:
            return None
        return self.to_angle(self.positions[-1])

    def to_angle(self, ticks: int) -> float:
        """Convert a position to the angle from the middle of its turn [rad]."""
        return self.servo.table.to_si("present_position", ticks)


class Gauges:
    """Servos on a bus that are read in turn."""

    def __init__(self, bus: DynamixelBus, servos: Sequence[LooseServo]) -> None:
        """Prepare to read servos of an open bus."""
        self._bus = bus
        self.all = tuple(Gauge(servo) for servo in servos)

    def read(self) -> None:
        """Read every servo once.

        Raises:
            PortLostError: if the port is gone.
        """
        for gauge in self.all:
            servo = gauge.servo
            values = read_items(self._bus, servo.id, servo.table, PRESENT)
            if values is None:
                gauge.missed += 1
                continue
            gauge.note(values)
