"""Work in the background tells how far it is, and ends once it is cancelled."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from waiting import wait_until

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor
from humanoid_getup.progress.worker import passing_reports, report
from humanoid_getup.studio.jobs import Job

TIMEOUT = 60.0  # s; a wait ends with its event


class Apart(Job[Any, Any]):
    """Work in a process of its own, and how it ended."""

    def __init__(
        self, work: Callable[..., Any], report: Callable[[Progress], None] = print, **options: str
    ) -> None:
        self.ends = list[Any]()
        super().__init__(work, lambda _, end: self.ends.append(end), report, **options)

    def do(self, request: object) -> Any:
        self.ask(request)
        assert self.wait(TIMEOUT)
        (end,) = self.ends
        return end


def double(request: int, report: Callable[[Progress], None], cancel: Callable[[], bool]) -> int:
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("doubling")
    monitor.tell("easy")
    return 2 * request


def fail(request: str, *_: object) -> None:
    raise ValueError(request)


def die(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def obey(_: object, report: Callable[[Progress], None], cancel: Callable[[], bool]) -> None:
    report(Progress(phase="begun"))
    while not cancel():
        threading.Event().wait(0.01)
    raise CancelledError("cancelled")


def ignore(_: object, report: Callable[[Progress], None], *__: object) -> None:
    report(Progress(phase=str(os.getpid())))
    threading.Event().wait()


def test_a_job_reports_its_progress_and_its_result():
    seen, changes = list[Progress](), list[bool]()
    job = Apart(double, seen.append)
    job.when_changed.append(changes.append)
    assert job.do(21) == 42
    assert seen == [Progress(phase="doubling"), Progress(message="easy")]
    assert changes == [True, False]
    assert not job.is_running


def nest(_: object, receive: Callable[[Progress], None], *__: object) -> None:
    with passing_reports(receive):
        report(Progress(phase="piece"))


def test_a_job_passes_on_what_its_pieces_report():
    seen = list[Progress]()
    assert Apart(nest, seen.append).do(None) is None
    assert seen == [Progress(phase="piece")]


@pytest.mark.parametrize(("work", "problem"), [(fail, "no such robot"), (die, "process ended")])
def test_a_job_that_fails_or_is_killed_says_so(work: Callable[..., None], problem: str):
    assert problem in str(Apart(work).do("no such robot"))


@pytest.mark.parametrize("work", [obey, ignore])
def test_a_cancelled_job_ends_even_if_it_does_not_listen(work: Callable[..., None]):
    begun, phases = threading.Event(), list[str]()

    def note(progress: Progress) -> None:
        phases.append(progress.phase)
        begun.set()

    job = Apart(work, note, busy="it works, expected its end")
    job.ask(None)
    assert begun.wait(TIMEOUT)
    with pytest.raises(BadInputError, match="it works, expected its end, or Cancel first"):
        job.ask(None)
    job.cancel()
    assert job.wait(TIMEOUT)
    assert [type(end) for end in job.ends] == [CancelledError]
    if work is ignore:
        with pytest.raises(ProcessLookupError):
            os.kill(int(phases[0]), 0)


def hold(file: str, report: Callable[[Progress], None], *_: object) -> None:
    """Hold a robot: what stands for its release is a file."""
    try:
        report(Progress(phase=str(os.getpid())))
        threading.Event().wait()
    finally:
        Path(file).write_text("released")


PARENT = """
import sys, threading
from test_jobs import hold
from humanoid_getup.studio.jobs import Job

if __name__ == "__main__":
    Job(hold, print, lambda progress: print(progress.phase, flush=True)).ask(sys.argv[1])
    threading.Event().wait()
"""


def test_a_job_whose_parent_is_killed_releases_the_robot(tmp_path: Path):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    paths = os.pathsep.join([str(Path(__file__).parent), *filter(None, sys.path)])
    with subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "robot")],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": paths},
    ) as parent:
        assert parent.stdout.readline()  # the job has begun
        parent.kill()
    wait_until(lambda: (tmp_path / "robot").exists())


LONGEST = 60.0  # s; only a broken program takes that long


class Bench:
    """Work that begins when it is asked for and ends when it is let go."""

    def __init__(self) -> None:
        self.begun, self.go = threading.Semaphore(0), threading.Semaphore(0)
        self.ends = list[str | Exception]()
        self.job = Job[str, str](self.work, lambda _, end: self.ends.append(end))

    def work(self, request: str, cancel) -> str:
        self.begun.release()
        assert self.go.acquire(timeout=LONGEST)
        if cancel():
            raise CancelledError
        if request == "bad":
            raise ValueError("it is bad, expected better")
        return request.upper()

    def finish(self) -> list[str | Exception]:
        for _ in range(9):
            self.go.release()
        assert self.job.wait(LONGEST)
        return self.ends


def test_requests_that_wait_replace_each_other():
    bench = Bench()
    bench.job.ask("first", at_once=False)
    assert bench.begun.acquire(timeout=LONGEST)
    for request in ("second", "third", "fourth"):
        bench.job.ask(request, at_once=False)
    assert bench.finish() == ["FIRST", "FOURTH"]


def test_a_request_at_once_ends_the_one_that_runs():
    bench = Bench()
    bench.job.ask("first")
    assert bench.begun.acquire(timeout=LONGEST)
    bench.job.ask("second")
    assert bench.finish() == ["SECOND"]


def test_a_request_that_waits_ends_as_cancelled_as_well():
    bench = Bench()
    bench.job.ask("first", at_once=False)
    assert bench.begun.acquire(timeout=LONGEST)
    bench.job.ask("second", at_once=False)
    bench.job.cancel()
    assert [type(end) for end in bench.finish()] == [CancelledError, CancelledError]


def test_an_error_is_an_end_and_the_next_request_is_done():
    bench = Bench()
    bench.job.ask("bad", at_once=False)
    assert bench.begun.acquire(timeout=LONGEST)
    bench.job.ask("good", at_once=False)
    assert list(map(str, bench.finish())) == ["it is bad, expected better", "GOOD"]
