"""A chip on a virtual I2C bus, which another process serves at a UNIX socket.

Each packet to the bus is a transfer: address of the chip, number of bytes to read, bytes to write.
The reply is an error number of Linux, or 0 and the bytes that were read. A bus greets its clients.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
import time
from pathlib import Path

from drivers.imu.i2c import I2cChip
from drivers.serial_port import REOPEN_EVERY
from drivers.socket_path import reaching

TRANSFER = struct.Struct("<BH")
GREETING = b"humanoid-getup I2C 1"
LONGEST_PACKET = 1 << 17  # bytes, beyond any transfer
TIMEOUT = 0.5  # s for a transfer; adapters of Linux give up after a second
ENDED, FOREIGN = "the virtual bus has ended", "is no I2C bus"


class SocketI2cChip(I2cChip):
    """A chip behind a socket; a transfer waits until it is done, or its time is up.

    A bus that has ended is opened again once it is back, as one that was unplugged.
    """

    def __init__(self, bus: str, address: int) -> None:
        """Name a chip by the path of its bus, and its address there."""
        self._bus, self._address = bus, address
        self.path = f"{bus} at 0x{address:02X}"
        self._is_open = False
        self._line: socket.socket | None = None
        self._reopen_at = 0.0

    def open(self) -> None:
        """Open the bus."""
        if self._line is None:
            self._line = _connect(self._bus)
        self._is_open = True

    def close(self) -> None:
        """Close the bus."""
        self._is_open = False
        self._drop()

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes, then read some after a repeated start condition."""
        if not self._is_open:
            raise OSError(errno.EBADF, "its bus is closed")
        line = self._line or self._reopen()
        try:
            line.send(TRANSFER.pack(self._address, count) + data)
            reply = line.recv(LONGEST_PACKET)
        except OSError as error:  # a late reply must not be taken for that to the next transfer
            self._drop()
            raise OSError(errno.ETIMEDOUT, ENDED) from error
        if not reply:
            self._drop()
            raise OSError(errno.EPIPE, ENDED)
        if reply[0]:
            raise OSError(reply[0], os.strerror(reply[0]))
        return reply[1:]

    def _reopen(self) -> socket.socket:
        if time.monotonic() < self._reopen_at:
            raise OSError(errno.EPIPE, ENDED)
        self._reopen_at = time.monotonic() + REOPEN_EVERY
        self._line = _connect(self._bus)
        return self._line

    def _drop(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            line.close()


def _connect(path: str) -> socket.socket:
    """Connect to a virtual bus, which greets."""
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.settimeout(TIMEOUT)
    try:
        with reaching(Path(path)) as address:
            line.connect(address)
        if line.recv(LONGEST_PACKET) != GREETING:
            raise OSError(errno.EPROTO, FOREIGN)
    except OSError as error:
        line.close()
        raise OSError(error.errno, _explain(path, error)) from error
    return line


def _explain(path: str, error: OSError) -> str:
    """Explain why a path is no bus to connect to."""
    if error.errno == errno.ECONNREFUSED and Path(path).is_socket():
        return ENDED
    if error.errno in (errno.ENOENT, errno.EACCES, errno.ENAMETOOLONG):
        return os.strerror(error.errno)
    return FOREIGN
