"""A chip on an I2C bus of Linux."""

from __future__ import annotations

import ctypes
import fcntl
import os
from typing import Protocol

# From Linux' uapi/linux/i2c-dev.h and i2c.h.
I2C_RDWR, I2C_M_RD = 0x0707, 0x0001


class I2cChip(Protocol):
    """What a sensor needs of its chip on an I2C bus; its errors are `OSError`."""

    @property
    def path(self) -> str:
        """Return bus and address in messages."""
        ...

    def open(self) -> None:
        """Open the bus; harmless if it is open."""

    def close(self) -> None:
        """Close it; harmless if it is closed."""

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes, then read some in the same transfer; either may be none."""
        ...


class _Message(ctypes.Structure):
    _fields_ = (
        ("address", ctypes.c_uint16),
        ("flags", ctypes.c_uint16),
        ("length", ctypes.c_uint16),
        ("buffer", ctypes.c_void_p),
    )


class _Transfer(ctypes.Structure):
    _fields_ = (("messages", ctypes.POINTER(_Message)), ("count", ctypes.c_uint32))


class LinuxI2cChip:
    """A chip behind /dev/i2c-N; a transfer waits until it is done."""

    def __init__(self, bus: int, address: int) -> None:
        self._device, self._address = f"/dev/i2c-{bus}", address
        self._fd = -1

    @property
    def path(self) -> str:
        """Return bus and address in messages."""
        return f"{self._device} at 0x{self._address:02X}"

    def open(self) -> None:
        """Open the bus."""
        if self._fd < 0:
            self._fd = os.open(self._device, os.O_RDWR)

    def close(self) -> None:
        """Close the bus."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes, then read some after a repeated start condition."""
        sent, received = ctypes.create_string_buffer(data, len(data)), (ctypes.c_char * count)()
        parts = [(0, sent, len(data))] if data else []
        parts += [(I2C_M_RD, received, count)] if count else []
        messages = (_Message * len(parts))(
            *(
                _Message(self._address, flags, length, ctypes.addressof(buffer))
                for flags, buffer, length in parts
            )
        )
        fcntl.ioctl(self._fd, I2C_RDWR, _Transfer(messages, len(parts)))
        return received.raw
