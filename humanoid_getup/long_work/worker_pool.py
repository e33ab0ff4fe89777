"""A pool of worker processes that are terminated with the block that uses them."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

SPAWN = multiprocessing.get_context("spawn")


@contextmanager
def worker_pool(
    jobs: int, start: Callable[..., None], *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """Run fresh processes, each of which calls ``start`` once; terminate them at the end.

    The arguments may be queues of the context `SPAWN`.
    """
    before = multiprocessing.active_children()
    pool = ProcessPoolExecutor(jobs, SPAWN, _start_worker, (start, *arguments))
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            if process not in before:
                process.terminate()


def _start_worker(start: Callable[..., None], *arguments: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    start(*arguments)
