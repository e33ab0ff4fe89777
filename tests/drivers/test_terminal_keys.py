"""A key pressed on a terminal stops the robot; no terminal, no key."""

import contextlib
import os
import termios
import threading

import pytest
from waiting import LONGEST_WAIT

from drivers.terminal_keys import LOST, PRESSED, StopKey


class Heard:
    def __init__(self) -> None:
        self.reasons: list[str] = []
        self.event = threading.Event()

    def __call__(self, reason: str) -> None:
        self.reasons.append(reason)
        self.event.set()


@pytest.fixture
def terminal():
    master, slave = os.openpty()
    yield master, slave
    for descriptor in (master, slave):
        with contextlib.suppress(OSError):  # a test closed it
            os.close(descriptor)


@pytest.mark.parametrize("sent", [b" ", b"\x1b[A", "ä".encode(), b"\r\n"])
def test_a_key_is_one_press_however_many_bytes_it_sends(terminal, sent: bytes):
    master, slave = terminal
    heard = Heard()
    with StopKey(heard, slave) as key:
        assert key.has_terminal
        os.write(master, sent)
        assert heard.event.wait(LONGEST_WAIT)
        heard.event.clear()
        os.write(master, b" ")
        assert heard.event.wait(LONGEST_WAIT)
    assert heard.reasons == [PRESSED, PRESSED]


def test_a_terminal_that_goes_away_stops_too(terminal):
    master, slave = terminal
    heard = Heard()
    with StopKey(heard, slave):
        os.close(master)
        assert heard.event.wait(LONGEST_WAIT)
    assert heard.reasons == [LOST]


def test_without_a_key_there_is_no_stop_and_what_comes_through_a_pipe_is_none(terminal):
    _, slave = terminal
    before, heard = termios.tcgetattr(slave), Heard()
    with StopKey(heard, slave):
        assert termios.tcgetattr(slave) != before
    assert termios.tcgetattr(slave) == before
    reader, writer = os.pipe()
    os.write(writer, b" ")
    with StopKey(heard, reader):
        pass
    assert heard.reasons == []
    assert os.read(reader, 1) == b" ", "the program's own input was eaten"
    os.close(reader)
    os.close(writer)
