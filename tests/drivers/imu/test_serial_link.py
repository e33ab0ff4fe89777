"""A sensor's serial port: nothing waits and nothing raises once it is open."""

import pytest

from drivers.imu.serial_link import SerialLink
from drivers.imu.source import ImuError
from drivers.serial_port import REOPEN_EVERY, PortLostError, PortRefusedError


class Port:
    """A port in memory that may be unplugged."""

    path = "memory"

    def __init__(self) -> None:
        self.is_open = self.is_gone = False
        self.coming, self.sent = b"", b""
        self.opened = 0

    def open(self) -> None:
        if self.is_gone:
            raise PortRefusedError(self.path, "does not exist")
        self.opened += 1
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def read(self, deadline: float) -> bytes:
        assert deadline == 0.0, "it must not wait"
        self._check()
        came, self.coming = self.coming[:3], self.coming[3:]
        return came

    def write(self, data: bytes) -> None:
        self._check()
        self.sent += data

    def flush(self) -> int:
        count, self.coming = len(self.coming), b""
        return count

    def _check(self) -> None:
        if self.is_gone or not self.is_open:
            raise PortLostError(self.path)


@pytest.fixture
def port() -> Port:
    return Port()


@pytest.fixture
def link(port: Port) -> SerialLink:
    return SerialLink(port, "IMU")  # type: ignore[arg-type]


def test_a_port_that_does_not_open_says_what_to_check(port: Port, link: SerialLink):
    port.is_gone = True
    with pytest.raises(ImuError, match=r"IMU: port memory: does not exist; check its cable"):
        link.open()
    assert link.connections == 0


def test_a_lost_port_is_opened_again_after_a_while(port: Port, link: SerialLink, counted_time):
    link.open()
    port.is_gone = True
    assert link.receive() == b"" and not port.is_open
    link.send(b"lost")
    assert port.sent == b""
    assert link.receive() == b""  # a first try, in vain
    port.is_gone = False
    counted_time.sleep(0.9 * REOPEN_EVERY)
    assert link.receive() == b"" and link.connections == 1
    counted_time.sleep(0.1 * REOPEN_EVERY)
    link.receive()
    assert port.is_open and link.connections == 2
    link.send(b"back")
    assert port.sent == b"back"
