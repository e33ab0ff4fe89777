"""The virtual port is a serial port to its clients, and survives all that they do to it."""

import fcntl
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import serial

from drivers.errors import SetupError
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal

TIOCGEXCL = 0x80045440
HOLD_PORT = """
import fcntl, os, sys, termios, time
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.ioctl(port, termios.TIOCEXCL)
print("open", flush=True)
time.sleep(60)
"""


@pytest.fixture
def wire():
    wire = PseudoTerminal()
    yield wire
    wire.close()


def open_port(wire: PseudoTerminal) -> int:
    return os.open(wire.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def read_all(end: int, count: int) -> bytes:
    data = b""
    while len(data) < count and select.select([end], [], [], 5.0)[0]:
        data += os.read(end, count - len(data))
    return data


def test_an_unplugged_port_is_an_error_to_its_client_and_a_new_line_at_the_old_path(wire):
    path, client = wire.path, open_port(wire)
    wire.unplug()
    with pytest.raises(OSError):
        os.write(client, b"?")
    assert not os.path.lexists(wire.path)
    assert (wire.read(), wire.write(b"!"), wire.baud, wire.plugged) == (b"", 0, 0, False)
    wire.plug()
    again = open_port(wire)
    wire.write(b"hello")
    assert (wire.path, read_all(again, 5)) == (path, b"hello")
    with pytest.raises(OSError):
        os.write(client, b"?")
    for end in (client, again):
        os.close(end)


def test_a_killed_client_leaves_no_lock_and_no_answers_behind(wire: PseudoTerminal):
    command = [sys.executable, "-c", HOLD_PORT, wire.path]
    client = subprocess.Popen(command, stdout=subprocess.PIPE)
    assert client.stdout is not None
    assert client.stdout.readline() == b"open\n"
    wire.write(b"unread")
    assert not wire.tidy()  # it is somebody's
    port = open_port(wire) if os.geteuid() == 0 else None  # only root sees past the lock
    if port is not None:
        assert any(fcntl.ioctl(port, TIOCGEXCL, bytes(4)))
        os.close(port)
    client.send_signal(signal.SIGKILL)
    client.wait()
    assert wire.tidy()
    port = open_port(wire)
    assert not any(fcntl.ioctl(port, TIOCGEXCL, bytes(4)))
    assert not select.select([port], [], [], 0.0)[0]
    os.close(port)
    client.stdout.close()


def test_a_link_replaces_one_that_a_killed_bus_left_behind(tmp_path):
    link = tmp_path / "port"
    link.symlink_to("/dev/pts/no-such")
    wire = PseudoTerminal(link)
    assert wire.path == str(link)
    assert link.is_char_device()
    wire.close()
    assert not os.path.lexists(link)


@pytest.mark.parametrize("target", ["/dev/null", "/dev/ttyUSB-unplugged", "another"])
def test_what_the_bus_did_not_make_is_refused_and_stays(tmp_path, target: str):
    link, file = tmp_path / "robot", tmp_path / "notes"
    link.symlink_to(target)
    file.write_text("mine")
    for place, text in (
        (link, f"a link to {target} is there, name another path"),
        (file, "a file is there, name another path"),
        (tmp_path / "missing" / "port", "no folder"),
    ):
        with pytest.raises(SetupError, match=text):
            PseudoTerminal(place)
    assert (link.readlink(), file.read_text()) == (Path(target), "mine")


def test_a_wire_knows_the_rate_of_its_client_and_closing_removes_its_folder():
    wire = PseudoTerminal()
    folder = wire.link.parent
    for baud in (57600, 4_500_000, 1_234_567):
        with serial.Serial(wire.path, baud):
            assert wire.baud == baud
    wire.close()
    wire.close()
    assert not folder.exists()
