"""Calls of other threads, run by the thread that serves a bus."""

import os
import threading

import pytest
from served_queue import Serving

from drivers.virtual_bus.serving.call_queue import CallQueue


class Line:
    """A second line, on a pipe."""

    def __init__(self) -> None:
        self.end, self.writer = os.pipe()
        self.served: list[bytes] = []
        self.idles = 0

    def fileno(self) -> int:
        return self.end

    def serve(self) -> None:
        self.served.append(os.read(self.end, 100))

    def idle(self) -> None:
        self.idles += 1


@pytest.fixture
def serving():
    serving = Serving(CallQueue())
    yield serving
    serving.end()


def test_a_call_runs_in_the_serving_thread_and_returns_its_result(serving: Serving):
    assert serving.queue.call(threading.get_ident) == serving.thread.ident
    assert serving.queue.call(lambda: 6 * 7) == 42


def test_an_exception_is_raised_in_the_caller_and_serving_continues(serving: Serving):
    with pytest.raises(ZeroDivisionError):
        serving.queue.call(lambda: 1 / 0)
    assert serving.queue.call(lambda: True)


def test_before_and_after_serving_callers_run_their_own_calls():
    queue = CallQueue()
    assert queue.call(threading.get_ident) == threading.get_ident()
    serving = Serving(queue)
    serving.end()
    assert queue.call(threading.get_ident) == threading.get_ident()


def test_bytes_on_the_port_end_the_wait_and_those_of_a_line_are_served_first():
    queue, line = CallQueue(), Line()
    queue.lines.append(line)
    queue.open()
    end, writer = os.pipe()
    os.write(writer, b"port")
    os.write(line.writer, b"line")
    assert queue.wait(end, 60.0)
    assert line.served == [b"line"] and line.idles == 0
    os.read(end, 100)
    assert not queue.wait(end, 0.0)
    assert line.idles == 1, "nothing happened for a whole wait"
    queue.close()
    for descriptor in (end, writer, line.end, line.writer):
        os.close(descriptor)


def test_a_ring_ends_a_wait_and_is_no_idle_time():
    queue, line = CallQueue(), Line()
    queue.lines.append(line)
    queue.open()
    queue.ring()
    assert not queue.wait(-1, 60.0)
    assert line.idles == 0
    queue.close()
    queue.ring()  # harmless
