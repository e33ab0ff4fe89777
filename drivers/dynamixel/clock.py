"""Clocks of a backend on a bus: wall time, or counted control periods; that of a virtual robot."""

from __future__ import annotations

import time
from collections.abc import Sequence

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.serial_port import PortError, is_pseudo_terminal
from robots import Joint

WRAP = 32.768  # s after which Realtime Tick begins again (e-manual)
LEAST_LAG = 0.1  # s; less is no sign of a busy computer
LAG = (
    "the clock of the virtual robot fell {:.1f} s behind: this computer has too little time for "
    "its physics"
)


class Clock:
    """Time of a backend's measurements: wall time, from 0 at construction."""

    is_real = True
    """Whether it is wall time."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic() - self._start

    def pass_period(self, period: float) -> None:
        """Note the end of a cycle of a period [s]."""


class CycleClock(Clock):
    """Time of a virtual bus in lock-step: one period for each cycle."""

    is_real = False

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        """Return the time [s]."""
        return self._now

    def pass_period(self, period: float) -> None:
        """Advance by a period [s]."""
        self._now += period


class VirtualClock:
    """Compares the clock of the first servo on a pseudo-terminal with that of the wall.

    It must not restart meanwhile. AX, XL-320 and Feetech servos have no clock: of those, of real
    servos, and of a bus in lock-step, whose time stands still, nothing is said.
    """

    def __init__(self, bus: DynamixelBus, joints: Sequence[Joint]) -> None:
        """Begin to compare, on an open bus."""
        self._bus, self._joint = bus, joints[0]
        self._began, self._start = time.monotonic(), self._read()

    def describe_lag(self) -> str:
        """Describe by how much it has fallen behind since; empty if it has not, or is gone.

        A port that is closed meanwhile is opened for it.
        """
        if self._start is None:
            return ""
        port, passed = self._bus.port, time.monotonic() - self._began
        was_open = port.is_open
        try:
            port.open()
            now = self._read()
        except PortError:
            return ""
        finally:
            if not was_open:
                port.close()
        if now is None or now == self._start:
            return ""
        lag = (passed - (now - self._start) + WRAP / 2) % WRAP - WRAP / 2
        return "" if lag < LEAST_LAG else LAG.format(lag)

    def _read(self) -> float | None:
        table = table_named(self._joint.servo.model.name)
        if "realtime_tick" not in table or not is_pseudo_terminal(self._bus.port.path):
            return None
        item = table["realtime_tick"]
        tick = self._bus.read_item(self._joint.servo.id, item)
        return None if tick is None else item.to_si(tick)
