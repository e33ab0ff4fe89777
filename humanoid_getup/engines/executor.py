"""Does independent pieces of work with an executor, and keeps each result in a ledger."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache, partial
from itertools import islice
from multiprocessing import current_process
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from msgspec import convert

from humanoid_getup.engines.engine import LOST, TRIES, WORTH, Engine
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.progress.worker import Worker, passing_reports

POLL_TIME = 0.2  # s between two looks whether the work is canceled
MOST_SUBMITTED = 4096  # pieces at a time

Piece = TypeVar("Piece")
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
        self.events = SimpleQueue[Any]()
        """Receives the progress of pieces that are being done."""
        self._workers = [Worker(self.events.put) for _ in range(workers)]
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
        raise ValueError(LOST)


@contextmanager
def make_executor(
    engine: str = "local", address: str = "", *, pieces: int = 256, worth: int = WORTH
) -> Iterator[Executor]:
    """Start the workers of an engine, or connect to them; they end with the block.

    Args:
        engine: "local", "dask" or "slurm", with a number of workers as in "local:4". A single local
            worker is this process.
        address: Of a running Dask scheduler.
        pieces: Number of pieces, from which "local" chooses its workers.
        worth: Fewest pieces for which a worker process of this machine pays off.

    Raises:
        ValueError: if there is no such engine, or it cannot be used.
    """
    chosen = Engine.parse(engine, address)
    with ExitStack() as stack:
        if chosen.kind == "local":
            count = chosen.choose_workers(pieces, worth)
            executor = ThisProcess() if count == 1 else LocalProcesses(count)
            stack.callback(executor.shutdown, cancel_futures=True)
        else:
            from humanoid_getup.engines.dask_cluster import start_dask

            try:
                executor = stack.enter_context(start_dask(chosen))
            except ModuleNotFoundError as error:
                raise ValueError(
                    f"there is no package '{error.name}': "
                    f"pip install 'humanoid-getup[{chosen.kind}]'"
                ) from error
        yield executor


def is_here(executor: Executor) -> bool:
    """Return whether an executor does pieces in this process."""
    return isinstance(executor, ThisProcess)


def do_pieces(
    work: Callable[[Piece], Result],
    pieces: Mapping[str, Piece],
    executor: Executor,
    *,
    ledger: Ledger | None = None,
    kind: Any = Any,
    ended: Callable[[str, Result], object] = lambda *_: None,
    monitor: ProgressMonitor | None = None,
) -> dict[str, Result]:
    """Do pieces that a ledger does not hold yet; return all results, in the order of the pieces.

    What ends before an error or a cancellation is kept. In workers, ``work`` is unpickled once for
    all pieces: what it loads then may be kept in it.

    Args:
        work: Picklable function of a piece, which must not depend on what was done before.
        pieces: What to do, by name.
        executor: Does them in any order.
        ledger: Holds finished results, and keeps new ones.
        kind: Type to which results of the ledger are converted.
        ended: Called in this thread with each name and result, those of the ledger first.
        monitor: Shows what pieces report, and ends the work if it is canceled.

    Raises:
        CancelledError: if the work is canceled.
        ValueError: if a piece ends its worker repeatedly.
    """
    monitor, results = monitor or ProgressMonitor(), dict[str, Result]()
    kept = ledger.done if ledger is not None else {}
    for name in [name for name in pieces if name in kept]:
        results[name] = convert(kept[name], kind)
        ended(name, results[name])
    waiting = iter([name for name in pieces if name not in results])
    running, most = dict[Future[Result], str](), MOST_SUBMITTED
    events: SimpleQueue[Any] = getattr(executor, "events", None) or SimpleQueue()
    if is_here(executor):
        most = 1
    else:
        work = partial(_do_there, pickle.dumps(work))

    def end(future: Future[Result]) -> None:
        result = future.result()
        name = running.pop(future)
        if ledger is not None:
            ledger.add(name, result)
        results[name] = result
        ended(name, result)

    try:
        while True:
            with passing_reports(monitor.show):
                for name in islice(waiting, most - len(running)):
                    future = executor.submit(work, pieces[name])
                    running[future] = name
                    future.add_done_callback(events.put)
            if not running:
                return {name: results[name] for name in pieces}
            with suppress(Empty):
                event = events.get(timeout=POLL_TIME)
                if isinstance(event, Future):
                    end(event)
                else:
                    monitor.show(event)
            monitor.check()
    except BaseException:
        while not events.empty():  # what others did before is not lost
            future = events.get()
            if future in running and not future.cancelled() and not future.exception():
                end(future)
        raise
    finally:
        for future in running:
            future.cancel()


def _do_there(work: bytes, piece: object) -> Any:
    """Do a piece in a worker."""
    current_process().daemon = False  # as workers of Dask are, which then may start no processes
    with _one_at_a_time:  # of a worker with several threads
        try:
            return _load(work)(piece)
        except Exception as error:
            raise _make_portable(error) from None


_one_at_a_time = threading.Lock()
_load = lru_cache(maxsize=1)(pickle.loads)


def _make_portable(error: Exception) -> Exception:
    """Return an error that can be pickled: itself, or a plain one with its text."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        is_input = isinstance(error, ValueError)
        name = type(error).__name__
        return ValueError(str(error)) if is_input else RuntimeError(f"{name}: {error}")
    return error
