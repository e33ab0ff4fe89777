"""Clocks of a backend on a bus: wall time, or counted control periods."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Time of a backend's measurements."""

    is_real: bool
    """Whether it is wall time."""

    def now(self) -> float:
        """Return the time [s]."""
        ...

    def pass_period(self, period: float) -> None:
        """Note the end of a cycle of a period [s]."""


class WallClock(Clock):
    """Wall time, from 0 at construction."""

    is_real = True

    def __init__(self) -> None:
        self._start = time.monotonic()

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic() - self._start


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
