"""A chip on an I2C bus: of Linux, or a virtual one behind a UNIX socket."""

from __future__ import annotations

import errno
import os
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from drivers.serial_port import REOPEN_EVERY

if TYPE_CHECKING:
    from smbus2 import SMBus

REMEDY = "check its cable, its address, imu.i2c_bus in robot.toml or --port imu=PATH, and group i2c"
"""What to do about a bus that does not open, or a chip that does not reply."""
TRANSFER = struct.Struct("<BH")
GREETING = b"humanoid-getup I2C 1"
LONGEST_PACKET = 1 << 17  # bytes, beyond any transfer
TIMEOUT = 0.5  # s for a transfer; adapters of Linux give up after a second
ENDED, FOREIGN = "the virtual bus has ended", "is no I2C bus"
LONGEST_PATH = 107  # bytes of that of a socket (Linux, un.h); temporary folders may need more
LONGEST_NAME = LONGEST_PATH - len("/proc/self/fd/9999/")


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


class SocketI2cChip(I2cChip):
    """A chip on a virtual I2C bus, which another process serves at a UNIX socket.

    Each packet to the bus is a transfer: address of the chip, number of bytes to read, bytes to
    write. The reply is an error number of Linux, or 0 and the bytes that were read. A bus greets
    its clients. A transfer waits until it is done, or its time is up.

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
    if error.errno == errno.ECONNREFUSED and Path(path).is_socket():
        return ENDED
    if error.errno in (errno.ENOENT, errno.EACCES, errno.ENAMETOOLONG):
        return os.strerror(error.errno)
    return FOREIGN


@contextmanager
def reaching(path: Path) -> Iterator[str]:
    """Yield a path short enough for a UNIX socket: a long one leads through its opened folder."""
    if len(os.fsencode(path)) <= LONGEST_PATH:
        yield str(path)
        return
    if len(os.fsencode(path.name)) > LONGEST_NAME:
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), str(path))
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)
