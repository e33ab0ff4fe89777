"""Jobs: work in the background of the page, one request at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import Any, Generic, TypeVar

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.progress.callback import CancelledError, Report
from humanoid_getup.progress.worker import GRACE, Worker, run_here

Request = TypeVar("Request")
Result = TypeVar("Result")


class Job(Generic[Request, Result]):
    """Works on the newest request; it replaces those that wait, and the one that is worked on.

    Work of a process of its own is a command, or a function like one: it can be interrupted, and
    ends with this process at the latest. Other work is a function of a request and a ``cancel``.
    """

    def __init__(
        self,
        work: Callable[..., Result],
        ended: Callable[[Request, Result | Exception], None],
        report: Report | None = None,
        *,
        busy: str = "",
    ) -> None:
        """Prepare; nothing runs yet.

        Args:
            work: What is to be done; pickled for a process, as requests and results are.
            ended: Called in a thread with each request that was not replaced, and its result or
                error, `CancelledError` if it was cancelled.
            report: Called with the progress of a process of its own; None for work in this one.
            busy: Problem of a request while another one runs; empty if it replaces that.
        """
        self._work, self._ended, self._report, self._busy = work, ended, report, busy
        self._pool, self._lock = ThreadPoolExecutor(1, "job"), threading.RLock()
        self._runs: dict[Future[None], _Run] = {}
        self.when_changed: list[Callable[[bool], None]] = []
        """Called as a request is taken, with True, and as work ends, with False."""

    @property
    def is_apart(self) -> bool:
        """Return whether it has a process of its own."""
        return self._report is not None

    @property
    def is_running(self) -> bool:
        """Return whether a request is left to do."""
        return not self.wait(0.0)

    def check(self) -> None:
        """Refuse a request while one runs that is not to be replaced."""
        if self._busy and self.is_running:
            raise BadInputError(f"{self._busy}, or Cancel first")

    def ask(self, request: Request, *, at_once: bool = True) -> None:
        """Request work, in place of what waits, and ``at_once`` in place of what runs, too."""
        with self._lock:
            self.check()
            for run in self._list_left():
                if at_once or not run.has_begun:
                    run.is_replaced = True
                    run.cancel()
            run = _Run(self._report)
            self._tell(is_running=True)
            self._runs[self._pool.submit(self._do, request, run)] = run

    def cancel(self) -> None:
        """Drop what waits, and end what runs; a process that does not end soon is interrupted."""
        with self._lock:
            for run in self._list_left():
                run.cancel()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait up to a time [s] until nothing is left to do; return whether that is so."""
        return not wait(list(self._runs), timeout).not_done

    def _list_left(self) -> list[_Run]:
        self._runs = {future: run for future, run in self._runs.items() if not future.done()}
        return list(self._runs.values())

    def _do(self, request: Request, run: _Run) -> None:
        if run.is_replaced:
            return
        run.has_begun = True
        end: Result | Exception
        try:
            end = run.do(self._work, request)
        except BrokenProcessPool:
            end = RuntimeError("the job's process ended")
        except KeyboardInterrupt:
            end = CancelledError()
        except Exception as error:
            end = error
        if not run.is_replaced:
            self._tell(is_running=False)
            self._ended(request, CancelledError() if run.cancelled.is_set() else end)

    def _tell(self, *, is_running: bool) -> None:
        for update in self.when_changed:
            update(is_running)


class _Run:
    """Work on one request."""

    def __init__(self, report: Report | None) -> None:
        self._worker = None if report is None else Worker(report)
        self.cancelled, self.has_begun, self.is_replaced = threading.Event(), False, False

    def cancel(self) -> None:
        self.cancelled.set()
        if self._worker is not None:
            self._worker.cancel(GRACE)

    def do(self, work: Callable[..., Any], request: object) -> Any:
        if self.cancelled.is_set():
            raise CancelledError("cancelled")
        if self._worker is None:
            return work(request, self.cancelled.is_set)
        try:
            return self._worker.submit(partial(run_here, work, request)).result()
        finally:
            self._worker.end()
