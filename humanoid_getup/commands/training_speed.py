"""Training speed: how fast a long work moves now, and how long the rest will take."""

from __future__ import annotations

import math
from collections import deque

REMEMBERED = 20  # last reports: long enough to be steady, short enough to be honest


class TrainingSpeed:
    """Rate over the last reports, all that happens between them included."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque(maxlen=REMEMBERED)

    def note(self, now: float, done: int) -> None:
        """Remember that so much is done at a time [s]."""
        self._seen.append((now, done))

    @property
    def rate(self) -> float:
        """Return what is done a second; nan while nobody can know."""
        if len(self._seen) < 2 or self._seen[-1][0] <= self._seen[0][0]:
            return math.nan
        (began, before), (now, done) = self._seen[0], self._seen[-1]
        return (done - before) / (now - began)

    def time_to_go(self, total: int) -> float:
        """Return how long the rest takes at this rate [s]; nan while nobody can know."""
        if not self.rate > 0.0:
            return math.nan
        return (total - self._seen[-1][1]) / self.rate


def format_time(seconds: float) -> str:
    """Write a duration for people: 42 s, 7 min, 1 h 05 min; ? for nan."""
    if math.isnan(seconds):
        return "?"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
