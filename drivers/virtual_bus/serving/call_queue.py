"""Calls from other threads to the one that serves a bus."""

from __future__ import annotations

import os
import select
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

T = TypeVar("T")


class Calls:
    """Takes what other threads want done, and lets the serving thread do it when it can.

    Nobody else touches devices or physics while a thread serves, so they need no locks.
    """

    def __init__(self) -> None:
        """Prepare; until `open` and after `close` callers do things themselves."""
        self._lock = threading.RLock()
        self._server: int | None = None
        self._waiting: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._bell: tuple[int, int] | None = None

    def open(self) -> None:
        """Let the thread that calls this be the serving one."""
        with self._lock:
            self._bell = os.pipe()
            for end in self._bell:
                os.set_blocking(end, False)
            self._server = threading.get_ident()

    def close(self) -> None:
        """Do what waits, and take no more."""
        with self._lock:
            self._server = None
            self._do_waiting()
            for end in self._bell or ():
                os.close(end)
            self._bell = None

    def call(self, action: Callable[[], T]) -> T:
        """Have something done by the serving thread; return what it returns."""
        with self._lock:
            if self._server in (None, threading.get_ident()):
                is_ours = True
            else:
                is_ours = False
                future: Future[T] = Future()
                self._waiting.append((action, future))
                self._ring()
        return action() if is_ours else future.result()

    def ring(self) -> None:
        """Wake the serving thread."""
        with self._lock:
            self._ring()

    def wait(self, line: int, duration: float) -> bool:
        """Wait for bytes, doing what is called for; tell whether bytes are there.

        Args:
            line: File descriptor of the bytes, -1 for none.
            duration: Longest wait [s]; less than 0 for no wait.
        """
        assert self._bell is not None
        bell = self._bell[0]
        ends = (bell,) if line < 0 else (line, bell)
        ready = select.select(ends, (), (), max(duration, 0.0))[0]
        if bell in ready:
            os.read(bell, 4096)
            self._do_waiting()
        return line in ready

    def _do_waiting(self) -> None:
        while self._waiting:
            action, future = self._waiting.popleft()
            try:
                future.set_result(action())
            except BaseException as error:  # it is the caller's, not the bus' own
                future.set_exception(error)

    def _ring(self) -> None:
        if self._bell is not None:
            try:
                os.write(self._bell[1], b"!")
            except BlockingIOError:
                return  # a full pipe wakes as well
