"""A sensor's serial port: read without waiting, and opened again after it was unplugged."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from drivers.errors import SetupError
from drivers.imu.source import ImuError

REOPEN_EVERY = 0.2  # s between two attempts to open a port that was lost
REMEDY = "check its cable, its power, and imu.port in robot.toml or --port imu=PATH"


class Port(Protocol):
    """What a sensor needs of a serial port; its errors are `SetupError`."""

    path: str

    @property
    def is_open(self) -> bool:
        """Return whether it is open."""
        ...

    def open(self) -> None:
        """Open it."""

    def close(self) -> None:
        """Close it."""

    def read(self, deadline: float) -> bytes:
        """Return received bytes, waiting until a time of the monotonic clock [s]."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes."""

    def flush(self) -> int:
        """Drop received bytes."""
        ...


OpenPort = Callable[[str, int], Port]
"""Makes a port of a path and a baud rate [bit/s]."""


class SerialLink:
    """A serial port that never waits and never raises once it is open."""

    def __init__(self, port: Port, name: str) -> None:
        self._port, self._name = port, name
        self._reopen_at = 0.0
        self.connections = 0
        """How often the port was opened: after each, a sensor may have restarted."""

    def open(self) -> None:
        """Open the port and drop what came before.

        Raises:
            ImuError: if it does not open.
        """
        if self._port.is_open:
            return
        try:
            self._port.open()
            self._port.flush()
        except SetupError as error:
            self._port.close()
            raise ImuError(self._name, str(error), REMEDY) from error
        self.connections += 1

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def receive(self) -> bytes:
        """Return all bytes that have arrived; try to open a lost port again."""
        data = b""
        try:
            if not self._port.is_open:
                self._reopen()
            while self._port.is_open and (more := self._port.read(0.0)):
                data += more
        except SetupError:  # unplugged
            self._port.close()
        return data

    def send(self, data: bytes) -> None:
        """Send bytes; those to a lost port are lost."""
        try:
            if self._port.is_open:
                self._port.write(data)
        except SetupError:
            self._port.close()

    def _reopen(self) -> None:
        if time.monotonic() >= self._reopen_at:
            self._reopen_at = time.monotonic() + REOPEN_EVERY
            self._port.open()
            self.connections += 1
