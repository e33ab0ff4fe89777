"""Executors of this machine: this process itself, and worker processes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from queue import SimpleQueue
from typing import Any, TypeVar

from humanoid_getup.engines.engine import TRIES, EngineError, describe_loss
from humanoid_getup.progress.callback import Progress
from humanoid_getup.progress.worker import Worker

Result = TypeVar("Result")


class ThisProcess(Executor):
    """Does each piece when it is submitted."""

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Do a piece; errors other than exceptions, such as `KeyboardInterrupt`, are raised."""
        future = Future[Result]()
        try:
            future.set_result(work(*arguments, **options))
        except Exception as error:
            future.set_exception(error)
        return future


class LocalProcesses(Executor):
    """Does pieces in worker processes; one that is killed costs the piece that it was at.

    One `ProcessPoolExecutor` breaks as a whole then; here each worker has its own.
    """

    def __init__(self, workers: int) -> None:
        """Prepare workers; each starts with its first piece."""
        self.reports = SimpleQueue[Progress]()
        """Progress of pieces that are being done."""
        self._workers = [Worker(self.reports.put) for _ in range(workers)]
        self._free = SimpleQueue[Worker]()
        for worker in self._workers:
            self._free.put(worker)
        self._threads = ThreadPoolExecutor(workers)

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Submit a piece: a function of a module and its arguments."""
        return self._threads.submit(self._do, partial(work, *arguments, **options))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End; with ``cancel_futures``, running pieces are interrupted as by Ctrl-C."""
        for worker in self._workers if cancel_futures else ():
            worker.cancel(grace=0.0)
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for worker in self._workers:
            worker.end()

    def _do(self, piece: Callable[[], Result]) -> Result:
        """Try a piece until its worker survives."""
        worker = self._free.get()
        try:
            for _ in range(TRIES):
                try:
                    return worker.submit(piece).result()
                except (BrokenProcessPool, KeyboardInterrupt):  # killed, or by SIGTERM
                    worker.end()
        finally:
            self._free.put(worker)
        raise EngineError(describe_loss())
