"""A port works, or says in one line why it does not; it never hangs."""

import errno
import fcntl
import os
import sys
import time

import pytest
import serial

from drivers.serial_port import SDK, PortError, PortLostError, SerialPort, is_pseudo_terminal
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal

PORTS = ("", SDK)


@pytest.fixture
def wire(tmp_path):
    wire = PseudoTerminal(tmp_path / "port")
    yield wire
    wire.close()


@pytest.fixture(params=PORTS)
def port(request, wire):
    port = SerialPort(request.param + wire.path, 1_000_000)
    port.open()
    yield port
    port.close()


def soon(seconds: float = 60.0) -> float:
    return time.monotonic() + seconds


def test_bytes_pass_as_they_are_in_both_directions_at_the_speed_that_is_set(port, wire):
    every = bytes(range(256))
    port.write(every)
    wire.write(every)
    for read in (wire.read, lambda: port.read(soon())):
        data = b""
        while len(data) < 256:
            data += read()
        assert data == every
    assert wire.baud == 1_000_000
    port.set_baud(2_000_000)
    assert (wire.baud, port.baud) == (2_000_000, 2_000_000)


def test_a_read_gives_nothing_at_its_deadline_or_after_a_flush(port, wire):
    before = time.monotonic()
    assert port.read(before + 0.05) == b""
    assert time.monotonic() >= before + 0.05
    assert port.read(before - 1.0) == b"", "a deadline that has passed"
    assert port.flush() == 0
    wire.write(b"late answer")
    deadline, count = soon(), 0
    while count < 11 and time.monotonic() < deadline:
        count += port.flush()
    assert count == 11
    assert port.read(time.monotonic()) == b""


@pytest.mark.parametrize("kind", PORTS)
def test_what_is_no_free_port_is_named(port, wire, kind, tmp_path):
    (tmp_path / "file").write_text("")
    for name, text in (("port", "in use by"), ("nothing", "does not exist; plug the adapter in"),
                       ("file", "is not a serial port")):  # fmt: skip
        with pytest.raises(PortError, match=rf"{name}: {text}"):
            SerialPort(kind + str(tmp_path / name), 1_000_000).open()
    port.close()
    other = SerialPort(kind + wire.path, 1_000_000)
    other.open()
    other.close()
    assert is_pseudo_terminal(kind + wire.path), "by the link, as users name it"
    for path in ("/dev/null", str(tmp_path / "file"), str(tmp_path / "nothing")):
        assert not is_pseudo_terminal(path)


def test_the_makers_library_that_is_missing_or_does_not_know_a_speed_is_named(wire, monkeypatch):
    with pytest.raises(PortError, match="4500000 bit/s is refused"):
        SerialPort(SDK + wire.path, 4_500_000).open()
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", None)
    with pytest.raises(PortError, match=r"no package .*: pip install 'humanoid-getup\[sdk\]'"):
        SerialPort(SDK + wire.path, 1_000_000).open()


def test_a_forbidden_port_names_the_group_to_join(tmp_path, monkeypatch):
    path = tmp_path / "port"
    path.write_text("")

    def refuse(*_, **__):
        raise serial.SerialException(errno.EACCES, "Permission denied")

    class Group:
        gr_name = "dialout"

    monkeypatch.setattr("drivers.serial_port.serial.Serial", refuse)
    monkeypatch.setattr("drivers.serial_port.grp.getgrgid", lambda _: Group)
    with pytest.raises(PortError) as caught:
        SerialPort(str(path), 1_000_000).open()
    assert "join the group 'dialout' (sudo usermod -aG dialout $USER)" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unplugged_port_is_lost_for_reading_and_for_writing(wire):
    for action in (lambda port: port.read(soon()), lambda port: port.write(b"x" * 8)):
        if not wire.plugged:
            wire.plug()
        port = SerialPort(wire.path, 1_000_000)
        port.open()
        wire.unplug()
        with pytest.raises(PortLostError, match="lost; is the adapter still plugged in"):
            for _ in range(10):
                action(port)
                time.sleep(0.01)
        port.close()
        assert not port.is_open


def test_an_adapter_that_hangs_does_not_hang_the_writer(wire):
    port = SerialPort(wire.path, 1_000_000)
    port.open()
    with pytest.raises(PortLostError):  # without a reader the queue is full at some point
        for _ in range(100):
            port.write(bytes(4096))
    port.close()


TIOCGEXCL = 0x80045440  # Linux' asm-generic/ioctls.h


def test_programs_that_ignore_locks_are_kept_out_while_it_is_open():
    """An administrator's programs may open it all the same, so that the flag itself is read."""
    master, slave = os.openpty()
    try:
        port = SerialPort(os.ttyname(slave), 1_000_000)
        port.open()
        assert any(fcntl.ioctl(slave, TIOCGEXCL, bytes(4)))
        port.close()
        assert not any(fcntl.ioctl(slave, TIOCGEXCL, bytes(4)))
    finally:
        os.close(master)
        os.close(slave)
