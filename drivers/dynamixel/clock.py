"""Clocks of a backend on a bus: wall time, or counted control periods."""

from __future__ import annotations

import time


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
