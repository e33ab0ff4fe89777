"""Latest job: quick work in a thread of this process, of which only the newest request counts."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from humanoid_getup.progress.background_job import JobEnd
from humanoid_getup.progress.callback import Cancel, CancelledError

Request = TypeVar("Request")
Result = TypeVar("Result")


class LatestJob(Generic[Request, Result]):
    """Works on one request at a time; while it works, later requests replace each other.

    Its thread ends when nothing is left to do.
    """

    def __init__(
        self, work: Callable[[Request, Cancel], Result], ended: Callable[[JobEnd[Result]], None]
    ) -> None:
        """Prepare; nothing runs yet.

        Args:
            work: Does a request, and raises `CancelledError` once its second argument says so.
            ended: Called in the thread with each end but those of cancelled requests.
        """
        self._work, self._ended = work, ended
        self._lock = threading.Lock()
        self._waiting: list[Request] = []  # one at most
        self._cancelled = threading.Event()
        self._thread: threading.Thread | None = None

    def ask(self, request: Request, *, at_once: bool = True) -> None:
        """Request work, in place of what waits, and ``at_once`` in place of what runs, too."""
        with self._lock:
            self._waiting = [request]
            if at_once:
                self._cancelled.set()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="latest job", daemon=True)
                self._thread.start()

    def cancel(self) -> None:
        """Drop what waits, and end what runs."""
        with self._lock:
            self._waiting = []
            self._cancelled.set()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait up to a time [s] until nothing is left to do; return whether that is so."""
        thread = self._thread
        if thread is not None:
            thread.join(timeout)
        return thread is None or not thread.is_alive()

    def _run(self) -> None:
        while (request := self._take()) is not None:
            cancelled = self._cancelled
            try:
                end = JobEnd(result=self._work(request[0], cancelled.is_set))
            except CancelledError:
                continue
            except Exception as error:
                end = JobEnd[Result](problem=str(error) or type(error).__name__)
            if not cancelled.is_set():
                with contextlib.suppress(Exception):  # the caller tells it; the thread goes on
                    self._ended(end)

    def _take(self) -> list[Request] | None:
        """Return the request that waits, in a list; without one, end the thread."""
        with self._lock:
            request, self._waiting = self._waiting, []
            self._cancelled = threading.Event()
            if not request:
                self._thread = None
            return request or None
