"""The operator's key: it ends the hold of a standing robot, and stops a moving one."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from drivers import SafetyGuard
from drivers.terminal_keys import StopKey
from humanoid_getup.commands.get_up.options import MoveOptions
from humanoid_getup.execution.session import Phase, PhaseChange

SAME_PRESS = 0.5  # s after a release within which a key repeats itself, or is pressed twice


class OperatorKey:
    """Any key of the terminal.

    In simulated time, which does not wait for a person, and without a terminal, a robot that is
    held counts as released: its command ends by itself.
    """

    def __init__(self, *, realtime: bool, terminal: int | None = None) -> None:
        """Prepare for a robot in real time, or in simulated time.

        The terminal is a file descriptor; ``None`` for standard input.
        """
        self._guard: SafetyGuard | None = None
        self._key = StopKey(self._press, terminal)
        self._is_watched = realtime
        self._is_holding = False
        self._released_at = -math.inf
        self._released = threading.Event()

    def is_released(self) -> bool:
        """Return whether a held robot may sit down."""
        return self._released.is_set() or not (self._is_watched and self._key.has_terminal)

    def note(self, change: PhaseChange) -> None:
        """Note the beginning of a phase: a key has another meaning while the robot stands."""
        self._is_holding = change.phase is Phase.HOLDING

    @contextmanager
    def watch(self, guard: SafetyGuard) -> Iterator[None]:
        """Watch the terminal while a robot moves."""
        self._guard = guard
        if not self._is_watched:
            yield
            return
        with self._key:
            yield

    def _press(self, reason: str) -> None:
        if self._is_holding:
            self._is_holding = False
            self._released_at = time.monotonic()
            self._released.set()
        elif self._guard is not None and time.monotonic() - self._released_at > SAME_PRESS:
            self._guard.stop(reason)


def watch_key(request: MoveOptions) -> dict[str, Any]:
    """Return the operator at the terminal, as an argument of what moves a robot."""
    return {"operator": OperatorKey(realtime=request.is_realtime)}
