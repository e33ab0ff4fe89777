"""Work in another process: it reports, can be interrupted, and ends with this one at the latest."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from humanoid_getup.progress.callback import Cancel, CancelledError, Progress, Report

SPAWN = get_context("spawn")
GRACE = 1.0  # s in which canceled work may end by itself, before it is interrupted
RELEASE = 10.0  # s in which interrupted work may release a robot, before its process ends

Result = TypeVar("Result")
Request = TypeVar("Request")

_cancelled = threading.Event()
_idle = threading.Event()
"""Set while this process has no work."""
_receive: Report = lambda _: None  # noqa: E731
"""Where reports of the work of this process go."""


def report(progress: Progress) -> None:
    """Report progress of work from anywhere within it; workers of clusters report nothing."""
    _receive(progress)


@contextmanager
def passing_reports(receive: Report) -> Iterator[None]:
    """Pass the reports of work in this process to a function."""
    global _receive
    before, _receive = _receive, receive
    try:
        yield
    finally:
        _receive = before


class Worker:
    """A process of a pool of its own: others do not notice when it ends.

    It starts with its first piece.
    """

    def __init__(self, receive: Report) -> None:
        """Prepare; ``receive`` is called in a thread with what pieces report."""
        self._receive, self._lock = receive, threading.Lock()
        self._pool: ProcessPoolExecutor | None = None
        self._cancelled = False

    def submit(self, work: Callable[[], Result]) -> Future[Result]:
        """Submit a piece: a picklable function, whose result is pickled as well.

        The future has `BrokenProcessPool` if the process is killed, and `KeyboardInterrupt` if it
        is interrupted.
        """
        with self._lock:
            if self._cancelled:
                raise CancelledError("cancelled")
            if self._pool is not None:
                return self._pool.submit(_do, work)
            self._pipe, theirs = SPAWN.Pipe()
            self._pool = ProcessPoolExecutor(1, SPAWN, _begin, (theirs,))
            future = self._pool.submit(_do, work)
            theirs.close()  # the process has its own
            self._reader = threading.Thread(target=self._read, args=(self._pipe,), daemon=True)
            self._reader.start()
        return future

    def cancel(self, grace: float) -> None:
        """Cancel all work; what does not end by itself in a time [s] is interrupted."""
        with self._lock, suppress(OSError):  # it has ended
            if self._pool is not None and not self._cancelled:
                self._pipe.send(grace)
            self._cancelled = True

    def end(self) -> None:
        """Wait until the process has ended and all that it reported is received."""
        if self._pool is not None:
            self._pool.shutdown()
            self._reader.join()
            self._pool = None

    def _read(self, pipe: Connection) -> None:
        with pipe, suppress(EOFError, OSError):
            while True:
                self._receive(pipe.recv())


def _begin(pipe: Connection) -> None:
    """Prepare the process."""
    global _receive
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers after Ctrl-C
    threading.Thread(target=_await_end, args=(pipe,), daemon=True).start()
    _receive = partial(_send, pipe)


def _send(pipe: Connection, progress: Progress) -> None:
    with suppress(OSError):  # the parent has ended
        pipe.send(progress)


def _await_end(pipe: Connection) -> None:
    """Interrupt the work when the parent says so or ends; end the process if that is no use."""
    grace, ended = GRACE, _idle  # without a parent, a result is lost
    with suppress(EOFError, OSError):
        grace, ended = pipe.recv(), threading.Event()
    _cancelled.set()
    threading.Event().wait(grace)
    os.kill(os.getpid(), signal.SIGTERM)
    ended.wait(RELEASE)
    os._exit(1)


def _do(work: Callable[[], Result]) -> Result:
    """Do a piece, which signals interrupt as Ctrl-C does."""
    signals = (signal.SIGTERM, signal.SIGHUP)
    _idle.clear()
    try:
        for number in signals:
            signal.signal(number, signal.default_int_handler)
        return work()
    finally:
        for number in signals:
            signal.signal(number, signal.SIG_DFL)
        _idle.set()


@dataclass(frozen=True, kw_only=True)
class JobEnd(Generic[Result]):
    """How a job ended."""

    result: Result | None = None
    """None if it failed or was cancelled."""
    problem: str = ""
    """Message of the error, if it failed."""
    cancelled: bool = False

    @classmethod
    def of(cls, work: Callable[[], Result]) -> JobEnd[Result]:
        """Do work, and return how it ended."""
        try:
            return JobEnd(result=work())
        except BrokenProcessPool:
            return JobEnd(problem="the job's process ended")
        except (CancelledError, KeyboardInterrupt):
            return JobEnd(cancelled=True)
        except Exception as error:
            return JobEnd(problem=str(error) or type(error).__name__)


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
            work: Function of a module that takes a request, ``report`` and ``cancel``, as commands
                do.
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
        self._end = JobEnd.of(self._future.result)
        self._worker.end()
        if self._is_cancelled:
            self._end = JobEnd(cancelled=True)
        self._ended(self._end)


def _run(work: Callable[..., Result], request: object) -> Result:
    # Not `report`: within the pieces of a job it leads to the job itself.
    return work(request, _receive, _cancelled.is_set)


class LatestJob(Generic[Request, Result]):
    """Does one request at a time, in a thread; of those that wait, the newest replaces the others.

    Args:
        work: Does a request, and raises `CancelledError` once its second argument says so.
        ended: Called in the thread with each end but those of cancelled requests.
    """

    def __init__(
        self, work: Callable[[Request, Cancel], Result], ended: Callable[[JobEnd[Result]], None]
    ) -> None:
        """Prepare; nothing runs yet."""
        self._work, self._ended = work, ended
        self._pool, self._lock = ThreadPoolExecutor(1, "latest job"), threading.RLock()
        self._futures = list[Future[None]]()
        self._cancelled = threading.Event()

    def ask(self, request: Request, *, at_once: bool = True) -> None:
        """Request work, in place of what waits, and ``at_once`` in place of what runs, too."""
        with self._lock:
            self.cancel(running=at_once)
            future = self._pool.submit(self._do, request, self._cancelled)
            self._futures = [future, *(each for each in self._futures if not each.done())]

    def cancel(self, *, running: bool = True) -> None:
        """Drop what waits, and end what runs."""
        with self._lock:
            for future in self._futures:
                future.cancel()
            if running:
                self._cancelled.set()
                self._cancelled = threading.Event()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait up to a time [s] until nothing is left to do; return whether that is so."""
        return not wait(self._futures, timeout).not_done

    def _do(self, request: Request, cancelled: threading.Event) -> None:
        end = JobEnd.of(lambda: self._work(request, cancelled.is_set))
        if not end.cancelled and not cancelled.is_set():
            self._ended(end)
