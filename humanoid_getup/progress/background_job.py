"""Background job: a job in a process of its own, which reports progress and can be ended."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

from humanoid_getup.progress.callback import Cancel, CancelledError, Report
from humanoid_getup.progress.worker import GRACE, Worker, find_receiver, is_cancelled

Result = TypeVar("Result")
Request = TypeVar("Request")


@dataclass(frozen=True, kw_only=True)
class JobEnd(Generic[Result]):
    """How a job ended."""

    result: Result | None = None
    """None if it failed or was cancelled."""
    problem: str = ""
    """Message of the error, if it failed."""
    cancelled: bool = False


class BackgroundJob(Generic[Result]):
    """Runs a job's function in a fresh process, which ends with this one at the latest."""

    def __init__(
        self,
        work: Callable[..., Result],
        request: object,
        *,
        report: Report = lambda _: None,
        ended: Callable[[JobEnd[Result]], None] = lambda _: None,
    ) -> None:
        """Start; ``report`` and ``ended`` are called in threads of this job.

        Args:
            work: Function of a module that takes a request, ``report`` and ``cancel``, as the
                functions of `humanoid_getup.jobs` do.
            request: Its request, which is pickled, as its result is.
            report: Called with each progress.
            ended: Called once, at the end.
        """
        self._worker, self._ended = Worker(report), ended
        self._future = self._worker.submit(partial(_run, work, request))
        self._end, self._is_cancelled = JobEnd[Result](), False
        self._thread = threading.Thread(target=self._follow, name="job", daemon=True)
        self._thread.start()

    @property
    def is_running(self) -> bool:
        """Return whether it has not ended."""
        return self._thread.is_alive()

    def cancel(self) -> None:
        """End it; a job that does not end by itself within a second is interrupted."""
        self._is_cancelled = True
        self._worker.cancel(GRACE)

    def wait(self, timeout: float | None = None) -> JobEnd[Result] | None:
        """Wait up to a time [s] for its end; return how it ended, None if it has not."""
        self._thread.join(timeout)
        return None if self._thread.is_alive() else self._end

    def _follow(self) -> None:
        try:
            end = JobEnd(result=self._future.result())
        except BrokenProcessPool:
            end = JobEnd(problem="the job's process ended")
        except (CancelledError, KeyboardInterrupt):
            end = JobEnd(cancelled=True)
        except Exception as error:
            end = JobEnd(problem=str(error) or type(error).__name__)
        self._worker.end()
        self._end = JobEnd(cancelled=True) if self._is_cancelled else end
        self._ended(self._end)


def _run(work: Callable[..., Any], request: object) -> Any:
    # Not `report`: within the pieces of a job it leads to the job itself.
    return work(request, find_receiver(), is_cancelled)


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
