"""Of requests that come while one is worked on, the newest alone is done."""

import threading

from humanoid_getup.progress.background_job import JobEnd, LatestJob
from humanoid_getup.progress.callback import CancelledError

LONGEST = 60.0  # s; only a broken program takes that long


class Bench:
    """Work that begins when it is asked for and ends when it is let go."""

    def __init__(self) -> None:
        self.begun, self.go = threading.Semaphore(0), threading.Semaphore(0)
        self.ends: list[JobEnd[str]] = []
        self.job = LatestJob[str, str](self.work, self.ends.append)

    def work(self, request: str, cancel) -> str:
        self.begun.release()
        assert self.go.acquire(timeout=LONGEST)
        if cancel():
            raise CancelledError
        if request == "bad":
            raise ValueError("it is bad, expected better")
        return request.upper()

    def finish(self) -> list[str | None]:
        for _ in range(9):
            self.go.release()
        assert self.job.wait(LONGEST)
        return [end.result for end in self.ends]


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


def test_after_it_is_cancelled_nothing_is_left_and_it_works_again():
    bench = Bench()
    bench.job.ask("first")
    assert bench.begun.acquire(timeout=LONGEST)
    bench.job.ask("second", at_once=False)
    bench.job.cancel()
    assert bench.finish() == []
    bench.job.ask("third")
    assert bench.finish() == ["THIRD"]


def test_an_error_is_an_end_and_the_next_request_is_done():
    bench = Bench()
    bench.job.ask("bad", at_once=False)
    assert bench.begun.acquire(timeout=LONGEST)
    bench.job.ask("good", at_once=False)
    assert bench.finish() == [None, "GOOD"]
    assert bench.ends[0].problem == "it is bad, expected better"
