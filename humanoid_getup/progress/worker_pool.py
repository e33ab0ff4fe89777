"""A pool of worker processes that end with the block that uses them, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

SPAWN = multiprocessing.get_context("spawn")


@contextmanager
def worker_pool(
    jobs: int, start: Callable[..., None], *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """Run fresh processes, each of which calls ``start`` once; terminate them at the end.

    Workers end, too, when this process is killed. The arguments may be queues of the context
    `SPAWN`.
    """
    before = multiprocessing.active_children()
    theirs, ours = SPAWN.Pipe(duplex=False)
    pool = ProcessPoolExecutor(jobs, SPAWN, _start_worker, (theirs, start, *arguments))
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            if process not in before:
                process.terminate()
        ours.close()
        theirs.close()


def _start_worker(parent: Connection, start: Callable[..., None], *arguments: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    start(*arguments)


def _end_with(parent: Connection) -> None:
    """End this process when the parent's end of a pipe closes: by the parent or its death."""
    try:
        parent.recv_bytes()
    except (EOFError, OSError):
        os._exit(1)
