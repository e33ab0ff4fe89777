"""Does independent pieces of work with an executor, and keeps each result in a ledger."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, lru_cache, partial
from itertools import islice
from multiprocessing import current_process
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from msgspec import convert

from humanoid_getup.engines.engine import WORTH, Engine, EngineError
from humanoid_getup.engines.local_processes import LocalProcesses, ThisProcess
from humanoid_getup.engines.versions import Versions
from humanoid_getup.progress.callback import ProgressMonitor, Report
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.progress.worker import passing_reports

POLL_TIME = 0.2  # s between two looks whether the work is canceled
MOST_SUBMITTED = 4096  # pieces at a time

Piece = TypeVar("Piece")
Result = TypeVar("Result")


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
        EngineError: if the engine cannot be used.
        ValueError: if there is no such engine.
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
                raise EngineError(
                    f"there is no package '{error.name}': "
                    f"pip install 'humanoid-getup[{chosen.kind}]'"
                ) from error
        yield executor


def do_pieces(
    work: Callable[[Piece], Result],
    pieces: Mapping[str, Piece],
    executor: Executor,
    *,
    ledger: Ledger | None = None,
    kind: Any = Any,
    ended: Callable[[str, Result], object] = lambda *_: None,
    monitor: ProgressMonitor | None = None,
    robot: str = "",
    receive: Report | None = None,
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
        monitor: Shows progress, and ends the work between two pieces if it is canceled.
        robot: Name or folder; a worker elsewhere is refused if it has another robot or program.
        receive: Receives what pieces report while they are done; default: the monitor shows it.

    Raises:
        CancelledError: if the work is canceled.
        EngineError: if a piece ends its worker repeatedly, or a worker has other versions.
    """
    results = dict[str, Result]()

    def end(name: str, result: Result, *, is_new: bool = True) -> None:
        if ledger is not None and is_new:
            ledger.add(name, result)
        results[name] = result
        ended(name, result)

    monitor = monitor or ProgressMonitor()
    kept = ledger.done if ledger is not None else {}
    for name in [name for name in pieces if name in kept]:
        end(name, convert(kept[name], kind), is_new=False)
    missing = {name: piece for name, piece in pieces.items() if name not in results}
    call = work if is_here(executor) else _send(work, robot)
    _run(call, missing, executor, end, monitor, receive or monitor.show)
    return {name: results[name] for name in pieces}


def is_here(executor: Executor) -> bool:
    """Return whether an executor does pieces in this process."""
    return isinstance(executor, ThisProcess)


def _run(
    call: Callable[[Piece], Result],
    pieces: Mapping[str, Piece],
    executor: Executor,
    end: Callable[[str, Result], None],
    monitor: ProgressMonitor,
    receive: Report,
) -> None:
    """Submit pieces, and hand each result over as it ends."""
    waiting, running = iter(pieces.items()), dict[Future[Result], str]()
    most = 1 if is_here(executor) else MOST_SUBMITTED
    events: SimpleQueue[Any] = (
        executor.reports if isinstance(executor, LocalProcesses) else SimpleQueue()
    )
    try:
        while True:
            with passing_reports(receive):
                for name, piece in islice(waiting, most - len(running)):
                    future = executor.submit(call, piece)
                    running[future] = name
                    future.add_done_callback(events.put)
            if not running:
                return
            with suppress(Empty):
                event = events.get(timeout=POLL_TIME)
                if isinstance(event, Future):
                    result = event.result()
                    end(running.pop(event), result)
                else:
                    receive(event)
            monitor.check()
    except BaseException:
        while not events.empty():  # what others did before is not lost
            future = events.get()
            if future in running and not future.cancelled() and not future.exception():
                end(running.pop(future), future.result())
        raise
    finally:
        for future in running:
            future.cancel()


def _send(work: Callable[[Piece], Result], robot: str) -> Callable[[Piece], Result]:
    """Return a function that does the work in a worker with the same versions."""
    return partial(_do_there, pickle.dumps(work), robot, Versions.find(robot))


def _do_there(work: bytes, robot: str, versions: Versions, piece: object) -> Any:
    """Do a piece in a worker."""
    current_process().daemon = False  # as workers of Dask are, which then may start no processes
    with _one_at_a_time:  # of a worker with several threads
        try:
            versions.check(_find_versions(robot))
            return _load(work)(piece)
        except Exception as error:
            raise _make_portable(error) from None


_one_at_a_time = threading.Lock()
_find_versions = cache(Versions.find)
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
