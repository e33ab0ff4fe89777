"""Worker processes of this machine, each with a pool of its own."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any, TypeVar

from humanoid_getup.engines.engine import EngineError
from humanoid_getup.engines.reports import set_receiver
from humanoid_getup.progress.callback import Progress, Report

TRIES = 3  # of a piece whose worker ends
EXIT = 5.0  # s that a worker has to leave its piece
SPAWN = get_context("spawn")

Result = TypeVar("Result")


class LocalProcesses(Executor):
    """Does pieces in processes of this machine.

    One `ProcessPoolExecutor` breaks as a whole when a worker is killed. Here each worker has a pool
    of its own, so that its piece alone is lost, which is tried again in a new one.
    """

    def __init__(self, workers: int) -> None:
        """Prepare workers; each starts its process with its first piece."""
        self.reports = SimpleQueue[Progress]()
        """Progress of pieces that are being done."""
        self._workers = [Worker(self.reports.put) for _ in range(workers)]
        self._free = SimpleQueue[Worker]()
        for worker in self._workers:
            self._free.put(worker)
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="worker")

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Submit a piece: a function of a module and its arguments."""
        return self._threads.submit(self._do, partial(work, *arguments, **options))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End; with ``cancel_futures``, running pieces are left as by an exception."""
        if not cancel_futures:
            self._threads.shutdown(wait)
        for worker in self._workers:
            worker.leave()
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for worker in self._workers:
            worker.end()

    def _do(self, piece: Callable[[], Result]) -> Result:
        worker = self._free.get()
        try:
            return worker.do(piece)
        finally:
            self._free.put(worker)


class Worker:
    """A process that does one piece at a time, and is replaced if it ends."""

    def __init__(self, receive: Report) -> None:
        """Prepare; ``receive`` is called in a thread with what pieces report."""
        self._receive, self._left = receive, threading.Event()
        self._lock = threading.Lock()
        self._pool: ProcessPoolExecutor | None = None
        self._pipe: Connection | None = None

    def do(self, piece: Callable[[], Result]) -> Result:
        """Do a piece.

        Raises:
            EngineError: if each of several processes ended with it.
        """
        for _ in range(TRIES):
            try:
                return self._submit(piece).result()
            except BrokenProcessPool:
                self.end()
        raise EngineError(
            f"a worker ended in each of {TRIES} tries of a piece, expected one that lasts: use "
            "fewer if memory ran out, or engine local:1 to see what happens, and resume"
        )

    def leave(self) -> None:
        """Leave the piece, which ends as by an exception, and all later ones."""
        with self._lock:
            self._left.set()
            if self._pipe is not None:
                with suppress(OSError):  # it has ended
                    self._pipe.send(None)

    def end(self) -> None:
        """Wait for the end of the process."""
        if self._pool is not None:
            self._pool.shutdown()
        self._pool = self._pipe = None

    def _submit(self, piece: Callable[[], Result]) -> Future[Result]:
        """Submit a piece; the first one starts the process."""
        with self._lock:
            if self._left.is_set():
                raise EngineError("the work was canceled")
            if self._pool is not None:
                return self._pool.submit(piece)
            self._pipe, theirs = SPAWN.Pipe()
            self._pool = ProcessPoolExecutor(1, SPAWN, _begin, (theirs,))
            future = self._pool.submit(piece)
            theirs.close()  # the process has its own
        threading.Thread(target=_pass_on, args=(self._pipe, self._receive), daemon=True).start()
        return future


def _pass_on(pipe: Connection, receive: Report) -> None:
    """Pass on what a worker reports, until it ends."""
    with suppress(EOFError, OSError):
        while True:
            receive(pipe.recv())


def _begin(pipe: Connection) -> None:
    """Prepare a worker, which ends with its parent at the latest."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    signal.signal(signal.SIGTERM, _leave)
    threading.Thread(target=_await_end, args=(pipe,), daemon=True).start()
    set_receiver(pipe.send)


def _leave(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise SystemExit(128 + signal.SIGTERM)


def _await_end(pipe: Connection) -> None:
    """Leave the piece when the parent says so or ends; leave the process if that takes long."""
    with suppress(EOFError, OSError):
        pipe.recv()
    os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait(EXIT)
    os._exit(1)
