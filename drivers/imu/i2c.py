"""A chip on an I2C bus of Linux."""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from smbus2 import SMBus

REMEDY = "check its cable, its address, imu.i2c_bus in robot.toml or --port imu=PATH, and group i2c"
"""What to do about a bus that does not open, or a chip that does not reply."""


class I2cChip(Protocol):
    """Access of a sensor to its chip on an I2C bus; errors are `OSError`."""

    path: str
    """Bus and address in messages."""

    def open(self) -> None:
        """Open the bus; harmless if it is open."""

    def close(self) -> None:
        """Close it; harmless if it is closed."""

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes, then read some in the same transfer; either may be none."""
        ...


class LinuxI2cChip(I2cChip):
    """A chip behind /dev/i2c-N; a transfer waits until it is done."""

    def __init__(self, bus: int | str, address: int) -> None:
        """Name a chip by its bus, N or a path, and its address there."""
        self._device = f"/dev/i2c-{bus}" if isinstance(bus, int) else bus
        self._address = address
        self.path = f"{self._device} at 0x{address:02X}"
        self._bus: SMBus | None = None

    def open(self) -> None:
        """Open the bus."""
        if self._bus is not None:
            return
        try:
            from smbus2 import SMBus  # for Linux alone
        except ImportError as error:
            raise OSError(errno.ENOSYS, "I2C needs Linux and the package smbus2") from error
        bus = SMBus()
        try:
            bus.open(self._device)
        except OSError:
            bus.close()
            raise
        self._bus = bus

    def close(self) -> None:
        """Close the bus."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.close()

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes, then read some after a repeated start condition."""
        from smbus2 import i2c_msg

        if self._bus is None:
            raise OSError(errno.EBADF, "its bus is closed")
        sent = [i2c_msg.write(self._address, data)] if data else []
        received = [i2c_msg.read(self._address, count)] if count else []
        self._bus.i2c_rdwr(*sent, *received)
        return bytes(received[0]) if received else b""
