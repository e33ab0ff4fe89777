"""Work in another process: it reports, can be interrupted, and ends with this one at the latest."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TypeVar

from humanoid_getup.progress.callback import CancelledError, Progress, Report

SPAWN = get_context("spawn")
GRACE = 1.0  # s in which canceled work may end by itself, before it is interrupted
RELEASE = 10.0  # s in which interrupted work may release a robot, before its process ends

Result = TypeVar("Result")

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


def run_here(work: Callable[..., Result], request: object) -> Result:
    """Do work on a request in this process of a `Worker`, as commands are called."""
    # Not `report`: within the pieces of a job it leads to the job itself.
    return work(request, _receive, _cancelled.is_set)
