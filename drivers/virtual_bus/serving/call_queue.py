"""Queue of calls from other threads to the one that serves a bus."""

from __future__ import annotations

import os
import select
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from drivers.virtual_bus.serving.interfaces import SideLine

T = TypeVar("T")


class CallQueue:
    """Queues actions of other threads; the serving thread runs them between instructions.

    Only the serving thread touches devices and physics, so they need no locks.
    """

    def __init__(self) -> None:
        """Create a closed queue: until `open` and after `close`, callers run their own actions."""
        self._lock = threading.RLock()
        self._server: int | None = None
        self._waiting: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._bell: int | None = None  # an eventfd
        self.lines: list[SideLine] = []
        """Further lines; what comes on them is handled before what came on the waiting one's."""

    def open(self) -> None:
        """Make the calling thread the serving one."""
        with self._lock:
            self._bell = os.eventfd(0)
            self._server = threading.get_ident()

    def close(self) -> None:
        """Run the queued actions; later ones run in their caller's thread."""
        with self._lock:
            self._server = None
            self._do_waiting()
            if self._bell is not None:
                os.close(self._bell)
            self._bell = None

    def call(self, action: Callable[[], T]) -> T:
        """Run an action in the serving thread; return its result."""
        with self._lock:
            is_ours = self._server in (None, threading.get_ident())
            future: Future[T] = Future()
            if not is_ours:
                self._waiting.append((action, future))
                self.ring()
        return action() if is_ours else future.result()

    def ring(self) -> None:
        """Wake the serving thread."""
        with self._lock:
            if self._bell is not None:
                os.eventfd_write(self._bell, 1)

    def wait(self, port: int, duration: float) -> bool:
        """Wait for bytes on a file descriptor, -1 for none; return whether bytes are there.

        Runs queued actions. Waits for ``duration`` seconds at most, below 0 not at all.
        """
        bell = self._bell
        assert bell is not None
        lines = {line.fileno(): line for line in self.lines}
        ends = [end for end in (port, bell, *lines) if end >= 0]
        ready = select.select(ends, (), (), max(duration, 0.0))[0]
        for end in lines.keys() & set(ready):
            lines[end].serve()
        if not ready:
            for line in self.lines:
                line.idle()
        if bell in ready:
            os.eventfd_read(bell)
            self._do_waiting()
        return port in ready

    def _do_waiting(self) -> None:
        while self._waiting:
            action, future = self._waiting.popleft()
            try:
                future.set_result(action())
            except BaseException as error:  # raised in the caller, not in the bus
                future.set_exception(error)
