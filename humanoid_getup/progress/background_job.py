"""Background job: a job in a process of its own, which reports progress and can be ended."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from humanoid_getup.progress.callback import CancelledError, Progress

SPAWN = multiprocessing.get_context("spawn")
GRACE = 1.0  # s that a cancelled job has to end by itself, before it is interrupted
RELEASE = 10.0  # s that an interrupted job has to release a robot

Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class JobEnd(Generic[Result]):
    """How a job ended."""

    result: Result | None = None
    """None if it failed or was cancelled."""
    problem: str = ""
    """Message of the error, if it failed."""
    cancelled: bool = False


class BackgroundJob(Generic[Result]):
    """Runs a job's function in a fresh process, which ends with this one at the latest."""

    def __init__(
        self,
        work: Callable[..., Result],
        request: object,
        *,
        report: Callable[[Progress], None] = lambda _: None,
        ended: Callable[[JobEnd[Result]], None] = lambda _: None,
    ) -> None:
        """Start; ``report`` and ``ended`` are called in a thread of this job.

        Args:
            work: Function of a module that takes a request, ``report`` and ``cancel``, as the
                functions of `humanoid_getup.jobs` do.
            request: Its request, which is pickled, as its result is.
            report: Called with each progress.
            ended: Called once, at the end.
        """
        self._report, self._ended = report, ended
        ours, theirs = SPAWN.Pipe()
        self._pipe, self._end = ours, JobEnd[Result](problem="the job's process ended")
        self._cancelled = threading.Event()
        self._process = SPAWN.Process(target=_run, args=(theirs, work, request))
        self._process.start()
        theirs.close()
        self._thread = threading.Thread(target=self._follow, name="job", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int | None:
        """Return the number of its process."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Return whether it has not ended."""
        return self._thread.is_alive()

    def cancel(self) -> None:
        """End it; a job that does not end by itself within a second is interrupted."""
        if self._cancelled.is_set():
            return
        self._cancelled.set()
        try:
            self._pipe.send(None)
        except OSError:  # it has ended
            return
        for delay, end in ((GRACE, self._process.terminate), (RELEASE, self._process.kill)):
            timer = threading.Timer(delay, _ignore_ended(end))
            timer.daemon = True
            timer.start()

    def wait(self, timeout: float | None = None) -> JobEnd[Result] | None:
        """Wait up to a time [s] for its end; return how it ended, None if it has not."""
        self._thread.join(timeout)
        return None if self._thread.is_alive() else self._end

    def _follow(self) -> None:
        """Pass messages on until the process ends."""
        try:
            while isinstance(message := self._pipe.recv(), Progress):
                self._report(message)
            self._end = message
        except (EOFError, OSError):  # it was killed
            pass
        except Exception as error:
            self._end = JobEnd(problem=f"{type(error).__name__}: {error}")
            self.cancel()
        self._process.join(RELEASE)
        self._process.kill()
        self._process.join()
        self._pipe.close()
        if self._cancelled.is_set():
            self._end = JobEnd(cancelled=True)
        self._ended(self._end)


def _ignore_ended(end: Callable[[], None]) -> Callable[[], None]:
    """Make a call that ends a process harmless for one that has ended and is closed."""

    def call() -> None:
        with contextlib.suppress(ValueError, OSError):
            end()

    return call


def _run(pipe: Connection, work: Callable[..., Any], request: object) -> None:
    """Run a job in this process; it is cancelled when the other end of the pipe closes.

    Signals interrupt it, so that it releases a robot; the parent ends its jobs after Ctrl-C.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    cancelled = threading.Event()

    def listen() -> None:
        try:
            pipe.recv()
        except (EOFError, OSError):
            threading.Timer(GRACE, os.kill, (os.getpid(), signal.SIGTERM)).start()
            threading.Timer(RELEASE, os._exit, (1,)).start()
        cancelled.set()

    threading.Thread(target=listen, daemon=True).start()
    try:
        end = JobEnd(result=work(request, pipe.send, cancelled.is_set))
    except (CancelledError, KeyboardInterrupt):
        end = JobEnd(cancelled=True)
    except Exception as error:
        end = JobEnd(problem=str(error) or type(error).__name__)
    with contextlib.suppress(OSError):  # the other end is gone
        pipe.send(end)
    os._exit(0)  # timers may be waiting
