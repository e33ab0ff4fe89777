"""The watch for what ends the robot's process besides its connection."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable

from drivers.interrupts import SIGNALS

PERIOD = 0.1  # s


class EndWatch:
    """Watches for a signal that ends the process, and for the death of its parent.

    The connection does not always tell of that: a child of LeRobot's process inherits it, and
    keeps it open.
    """

    def __init__(self) -> None:
        """Remember the parent; signals have the system's effect until the watch starts."""
        self._parent = os.getppid()
        self._was_signalled = False

    def start(self, end: Callable[[], None]) -> None:
        """Watch from now on, and call ``end`` once, in a thread of its own."""
        for name in SIGNALS:
            signal.signal(getattr(signal, name), self._note)
        threading.Thread(target=self._watch, args=(end,), daemon=True).start()

    def _note(self, _number: int, _frame: object) -> None:
        self._was_signalled = True  # no more: the signal may interrupt what holds a lock

    def _watch(self, end: Callable[[], None]) -> None:
        while os.getppid() == self._parent and not self._was_signalled:
            time.sleep(PERIOD)
        end()
