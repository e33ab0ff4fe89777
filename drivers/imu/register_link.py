"""Registers of a BNO055, over I2C or over a UART, one request at a time."""

from __future__ import annotations

import time
from typing import Protocol

from drivers.imu.i2c import REMEDY, I2cChip
from drivers.imu.serial_link import SerialLink
from drivers.imu.source import ImuError

# Frames of the BNO055 on a UART (data sheet, 4.7): AA, 01 to read or 00 to write, register,
# length, data. BB, length, data is the reply to a read; EE, status to a write or an error.
START, WRITE, READ = 0xAA, 0x00, 0x01
DATA, STATUS, DONE = 0xBB, 0xEE, 0x01
REPLY_TIME = 0.05  # s after which a reply is given up


class RegisterLink(Protocol):
    """A line to registers; nothing here waits, and only `open` raises."""

    is_busy: bool = False
    """Whether a reply is still to come."""
    damaged: int = 0
    """How many replies were dropped because they were damaged."""

    def open(self) -> None:
        """Open the line.

        Raises:
            ImuError: if that fails.
        """

    def close(self) -> None:
        """Close the line."""

    def read(self, register: int, count: int) -> None:
        """Request some registers."""

    def write(self, register: int, value: int) -> None:
        """Request that a register is set."""

    def take(self) -> bytes | None:
        """Return the reply: the registers, or nothing for a write; None if there is none yet."""
        ...


class I2cRegisters(RegisterLink):
    """Registers over I2C: the reply is available at once."""

    def __init__(self, chip: I2cChip, name: str) -> None:
        self._chip, self._name = chip, name
        self._reply: bytes | None = None

    def open(self) -> None:
        """Open the bus."""
        try:
            self._chip.open()
        except OSError as error:
            raise ImuError(self._name, f"{error.strerror}", REMEDY) from error

    def close(self) -> None:
        """Close the bus."""
        self._chip.close()

    def read(self, register: int, count: int) -> None:
        """Read some registers."""
        self._transfer(bytes([register]), count)

    def write(self, register: int, value: int) -> None:
        """Set a register."""
        self._transfer(bytes([register, value]), 0)

    def take(self) -> bytes | None:
        """Return the reply to the last request."""
        reply, self._reply = self._reply, None
        return reply

    def _transfer(self, data: bytes, count: int) -> None:
        try:
            self._reply = self._chip.transfer(data, count)
        except OSError:  # the chip does not acknowledge
            self._reply = None


class UartRegisters(RegisterLink):
    """Registers over a UART: the reply comes some cycles later, or never."""

    def __init__(self, link: SerialLink) -> None:
        self._link = link
        self._buffer = b""
        self._count = 0  # bytes of the expected reply; 0 for a write
        self._give_up_at = 0.0

    def open(self) -> None:
        """Open the port."""
        self._link.open()
        self.is_busy = False

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def read(self, register: int, count: int) -> None:
        """Request some registers."""
        self._send(bytes([START, READ, register, count]), count)

    def write(self, register: int, value: int) -> None:
        """Request that a register is set."""
        self._send(bytes([START, WRITE, register, 1, value]), 0)

    def take(self) -> bytes | None:
        """Return the reply if it is complete and answers the last request."""
        self._buffer += self._link.receive()
        if not self.is_busy:
            self._buffer = b""
            return None
        size = 2 + self._count
        head = bytes([DATA, self._count]) if self._count else bytes([STATUS, DONE])
        if not head.startswith(self._buffer[:2]):
            return self._drop()
        if len(self._buffer) >= size:
            if len(self._buffer) > size:
                return self._drop()
            reply, self._buffer, self.is_busy = self._buffer[2:], b"", False
            return reply
        if time.monotonic() > self._give_up_at:
            self.is_busy = False
        return None

    def _drop(self) -> None:
        """Drop a reply that is damaged or an error; a new request may follow."""
        self._buffer, self.is_busy = b"", False
        self.damaged += 1

    def _send(self, frame: bytes, count: int) -> None:
        self._link.receive()  # a late reply to an older request
        self._buffer, self._count, self.is_busy = b"", count, True
        self._give_up_at = time.monotonic() + REPLY_TIME
        self._link.send(frame)
