"""Executors of this machine: this process itself, and worker processes."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import queue
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

from humanoid_getup.engines.errors import EngineError, WorkerLostError
from humanoid_getup.engines.reports import passing_reports
from humanoid_getup.progress.background_job import SPAWN
from humanoid_getup.progress.callback import Progress, Report

TRIES = 3  # of a piece whose worker ends
EXIT = 5.0  # s that a terminated worker has to end

Result = TypeVar("Result")
REPORT = "report"
"""Kind of a message of a worker that is no result."""
Task = tuple[Future, Callable[..., Any], tuple[Any, ...]]


class ThisProcess(Executor):
    """Runs each piece when it is submitted."""

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Run a piece; the future is done when it is returned.

        Errors other than exceptions, such as `KeyboardInterrupt`, are raised here.
        """
        future = Future[Result]()
        try:
            future.set_result(work(*arguments, **options))
        except Exception as error:
            future.set_exception(error)
        return future


class LocalProcesses(Executor):
    """Runs pieces in processes of this machine, each of which does one at a time.

    A piece whose process ends, such as one that is killed, is tried again in a new process; the
    others do not notice.
    """

    def __init__(self, workers: int) -> None:
        """Start threads that start a process each with their first piece.

        Raises:
            EngineError: in a process that is being started by another one: a script whose work is
                not below ``if __name__ == "__main__"``.
        """
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            raise EngineError(
                "a worker starts workers as it is started, expected the script's work below "
                "`if __name__ == '__main__':`, or engine local:1"
            )
        self._tasks = queue.SimpleQueue[Task | None]()
        self.reports = queue.SimpleQueue[Progress]()
        """What pieces report while they are done."""
        self._ended = threading.Event()
        self._lock = threading.Lock()
        """Held while workers are added, or all of them are ended."""
        self._workers: set[WorkerProcess] = set()
        self._threads = [
            threading.Thread(target=self._serve, name=f"worker {number}", daemon=True)
            for number in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Queue a piece: a function of a module and its arguments, which are pickled.

        Raises:
            RuntimeError: after `shutdown`.
        """
        if self._ended.is_set():
            raise RuntimeError("the executor was shut down, expected one that runs")
        if options:
            raise TypeError("pieces have no keyword arguments, expected a partial function")
        future = Future[Result]()
        self._tasks.put((future, work, arguments))
        return future

    @property
    def process_ids(self) -> list[int]:
        """Return the numbers of its processes."""
        return [worker.pid for worker in tuple(self._workers)]

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End; what is waiting is done before, unless it is cancelled and processes are ended."""
        for _ in self._threads:
            self._tasks.put(None)
        if cancel_futures:
            with self._lock:
                self._ended.set()
                workers = tuple(self._workers)
            for worker in workers:
                worker.terminate()
            for worker in workers:
                worker.end()
        if wait:
            for thread in self._threads:
                thread.join()
        self._ended.set()

    def _serve(self) -> None:
        """Do pieces in a process until there are no more."""
        worker: WorkerProcess | None = None
        while (task := self._tasks.get()) is not None:
            future, work, arguments = task
            if self._ended.is_set():
                future.cancel()
            elif future.set_running_or_notify_cancel():
                worker = self._do(worker, future, work, arguments)
        self._drop(worker)

    def _do(
        self,
        worker: WorkerProcess | None,
        future: Future,
        work: Callable[..., Any],
        arguments: tuple[Any, ...],
    ) -> WorkerProcess | None:
        """Try a piece until its worker survives; return the worker."""
        reason = ""
        for _ in range(TRIES):
            try:
                worker = worker or self._start()
                result = worker.call(work, arguments, self.reports.put)
            except WorkerEndedError:
                reason = worker.end() if worker is not None else ""
                worker = self._drop(worker)
                if self._ended.is_set():
                    break
            except BaseException as error:
                future.set_exception(error)
                return worker
            else:
                future.set_result(result)
                return worker
        future.set_exception(WorkerLostError(TRIES, reason))
        return worker

    def _start(self) -> WorkerProcess:
        """Start a worker, unless all were ended meanwhile.

        Raises:
            WorkerEndedError: if they were.
        """
        worker = WorkerProcess()
        with self._lock:
            if not self._ended.is_set():
                self._workers.add(worker)
                return worker
        worker.end()
        raise WorkerEndedError

    def _drop(self, worker: WorkerProcess | None) -> None:
        if worker is not None:
            worker.end()
            self._workers.discard(worker)


class WorkerEndedError(Exception):
    """A worker ended before its piece."""


class WorkerProcess:
    """A fresh process that does one piece after another; it ends with this one at the latest."""

    def __init__(self) -> None:
        self._pipe, theirs = SPAWN.Pipe()
        # A piece may start processes, which one that is daemonic must not.
        self._process = SPAWN.Process(target=_work, args=(theirs,), daemon=False)
        self._process.start()
        theirs.close()

    @property
    def pid(self) -> int:
        """Return the number of the process."""
        return self._process.pid or 0

    def call(self, work: Callable[..., Any], arguments: tuple[Any, ...], receive: Report) -> Any:
        """Do a piece; return its result, or raise its error; pass on what it reports.

        Raises:
            WorkerEndedError: if the process ends.
        """
        succeeded, result = self._exchange(pickle.dumps((work, arguments)))
        while succeeded == REPORT:
            receive(result)
            succeeded, result = self._exchange()
        if succeeded:
            return result
        raise result

    def _exchange(self, message: bytes = b"") -> tuple[Any, Any]:
        """Send a message, if there is one; return the next answer."""
        try:
            if message:
                self._pipe.send_bytes(message)
            answer = self._pipe.recv_bytes()
        except (EOFError, OSError) as error:
            raise WorkerEndedError from error
        return pickle.loads(answer)

    def terminate(self) -> None:
        """Request its end: the piece that it does is left as by an exception."""
        self._process.terminate()

    def end(self) -> str:
        """End the process; return how it ended."""
        self.terminate()
        self._process.join(EXIT)
        self._process.kill()
        self._process.join()
        return describe_exit(self._process.exitcode)


def describe_exit(code: int | None) -> str:
    """Describe how a process ended."""
    if code is None or code >= 0:
        return f"exit code {code}"
    name = signal.Signals(-code).name
    return f"{name}, which a system without memory sends" if -code == signal.SIGKILL else name


def _work(pipe: Connection) -> None:
    """Do pieces until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers
    signal.signal(signal.SIGTERM, _terminate)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with passing_reports(lambda progress: pipe.send((REPORT, progress))):
        while True:
            try:
                message = pipe.recv_bytes()
            except (EOFError, OSError):
                return
            pipe.send_bytes(_answer(message))


class TerminatedError(SystemExit):
    """The parent ends this process: pieces keep what they have."""


def _terminate(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise TerminatedError(128 + signal.SIGTERM)


def _answer(message: bytes) -> bytes:
    """Do a piece; return whether it succeeded, and its result or its error."""
    try:
        work, arguments = pickle.loads(message)
        return pickle.dumps((True, work(*arguments)))
    except TerminatedError:
        raise
    except BaseException as error:
        return _write_error(error)


def _write_error(error: BaseException) -> bytes:
    """Pickle an error; one that cannot be pickled becomes a plain one with its text."""
    try:
        content = pickle.dumps((False, error))
        pickle.loads(content)
    except Exception:
        is_input = isinstance(error, ValueError)
        plain = (
            ValueError(str(error)) if is_input else RuntimeError(f"{type(error).__name__}: {error}")
        )
        content = pickle.dumps((False, plain))
    return content


def _end_with_parent() -> None:
    """End this process when its parent does, however that ends."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
