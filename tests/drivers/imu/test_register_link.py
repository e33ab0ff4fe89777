"""Registers of a BNO055 on a UART, one request at a time (data sheet, 4.7)."""

import pytest

from drivers.imu.bno055 import REPLY_TIME, UartRegisters


class Wire:
    """A line in memory: what was sent, and what comes."""

    def __init__(self) -> None:
        self.sent, self.coming = b"", b""

    def open(self) -> None: ...

    def close(self) -> None: ...

    def send(self, data: bytes) -> None:
        self.sent += data

    def receive(self) -> bytes:
        came, self.coming = self.coming, b""
        return came


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def link(wire: Wire) -> UartRegisters:
    return UartRegisters(wire)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "reply",
    ["EE 07", "BB 02 11 22", "BB 03 11 22 33 44", "00", "EE 01"],
    ids=["an error", "of other registers", "with more behind it", "noise", "to a write"],
)
def test_another_reply_is_dropped_and_the_next_request_starts_afresh(
    wire: Wire, link: UartRegisters, reply: str
):
    link.read(0x08, 3)
    wire.coming = bytes.fromhex(reply)
    assert link.take() is None
    assert not link.is_busy and link.damaged == 1
    link.read(0x08, 1)
    wire.coming = bytes.fromhex("BB 01 42")
    assert link.take() == b"\x42"


def test_a_reply_that_does_not_come_is_given_up(wire: Wire, link: UartRegisters, counted_time):
    link.read(0x08, 1)
    counted_time.sleep(0.9 * REPLY_TIME)
    assert link.take() is None and link.is_busy
    counted_time.sleep(0.1 * REPLY_TIME)
    assert link.take() is None and not link.is_busy
    wire.coming = bytes.fromhex("BB 01 41")  # late
    link.read(0x08, 1)
    wire.coming = bytes.fromhex("BB 01 42")
    assert link.take() == b"\x42"
