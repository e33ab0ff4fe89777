"""Runs independent pieces of work on an engine; each result is handed over as it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from itertools import islice
from queue import Empty, SimpleQueue
from typing import TypeVar

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.local_processes import LocalProcesses, ThisProcess
from humanoid_getup.engines.reports import passing_reports
from humanoid_getup.engines.workers import Workers
from humanoid_getup.progress.callback import ProgressMonitor, Report

POLL_TIME = 0.2  # s between two looks whether the work is canceled
QUEUED = 4  # pieces per worker that are submitted, so that none waits for this process

Piece = TypeVar("Piece")
Result = TypeVar("Result")
Ended = Callable[[str, Result], None]
"""Receives the name of a piece and its result."""


@contextmanager
def start_workers(engine: Engine, pieces: int) -> Iterator[Workers]:
    """Start the workers of an engine, or connect to them; they end with the block.

    Raises:
        EngineError: if it is not reachable.
        ModuleNotFoundError: if it is not installed.
    """
    if engine.kind == "ray":
        from humanoid_getup.engines.ray_cluster import start_ray as start
    elif engine.kind == "dask":
        from humanoid_getup.engines.dask_cluster import start_dask as start
    elif engine.kind == "slurm":
        from humanoid_getup.engines.dask_cluster import start_slurm as start
    else:
        start = _start_local
    with start(engine, pieces) as workers:
        yield workers


@contextmanager
def _start_local(engine: Engine, pieces: int) -> Iterator[Workers]:
    """Start processes of this machine; a single one is this process."""
    count = engine.choose_workers(pieces)
    if count == 1:
        yield Workers(executor=ThisProcess(), count=0)
        return
    executor = LocalProcesses(count)
    try:
        yield Workers(executor=executor, count=count, reports=executor.reports)
    finally:
        executor.shutdown(cancel_futures=True)


def run_pieces(
    work: Callable[[Piece], Result],
    pieces: Mapping[str, Piece],
    workers: Workers,
    ended: Ended[Result],
    monitor: ProgressMonitor | None = None,
    receive: Report | None = None,
) -> None:
    """Run pieces; call ``ended`` in this thread with each result, in whatever order they end.

    Args:
        work: Function of a module, or a partial one, that does a piece. It must not depend on what
            was done before.
        pieces: What to do, by name; pickled, as the results are.
        workers: Where to do it.
        ended: Receives each result.
        monitor: Ends the work between two pieces if it is canceled.
        receive: Receives what pieces report while they are done, in this thread; default: the
            monitor shows it.

    Raises:
        CancelledError: if the work is canceled.
        EngineError: if a worker is lost with the same piece repeatedly.
    """
    monitor = monitor or ProgressMonitor()
    receive = receive or monitor.show
    waiting = iter(pieces.items())
    running = dict[Future[Result], str]()
    finished = SimpleQueue[Future[Result]]()
    most = max(QUEUED * workers.count, 1)
    try:
        while True:
            with passing_reports(receive):
                for name, piece in islice(waiting, most - len(running)):
                    future = workers.executor.submit(work, piece)
                    running[future] = name
                    future.add_done_callback(finished.put)
            if not running:
                return
            with suppress(Empty):
                future = finished.get(timeout=POLL_TIME)
                _pass_reports(workers, receive)
                ended(running.pop(future), future.result())
            _pass_reports(workers, receive)
            monitor.check()
    except BaseException:
        for future in _list_finished(finished):  # what others did before is not lost
            if future in running and not future.cancelled() and not future.exception():
                ended(running.pop(future), future.result())
        raise
    finally:
        for future in running:
            future.cancel()


def _pass_reports(workers: Workers, receive: Report) -> None:
    """Pass on what pieces have reported before they ended."""
    while not workers.reports.empty():
        receive(workers.reports.get())


def _list_finished(finished: SimpleQueue[Future[Result]]) -> Iterator[Future[Result]]:
    """List the futures that are done."""
    while not finished.empty():
        yield finished.get()
