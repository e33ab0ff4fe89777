"""Clocks of a backend on a bus: the wall's, or one that counts control periods."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Tells a backend when its measurements were taken."""

    @property
    def is_real(self) -> bool:
        """Tell whether time passes by itself."""
        ...

    def now(self) -> float:
        """Return the time [s]."""
        ...

    def pass_period(self, period: float) -> None:
        """Note that a cycle has ended, which lasts so many seconds."""
        ...


class WallClock:
    """Time as on the wall, from 0 when it is made."""

    is_real = True

    def __init__(self) -> None:
        self._start = time.monotonic()

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic() - self._start

    def pass_period(self, period: float) -> None:
        """Do nothing: time passes by itself."""


class CycleClock:
    """Time as a virtual bus in lock-step has it: one period for each cycle."""

    is_real = False

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        """Return the time [s]."""
        return self._now

    def pass_period(self, period: float) -> None:
        """Let a cycle pass, which lasts so many seconds."""
        self._now += period
