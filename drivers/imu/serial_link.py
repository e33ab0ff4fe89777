"""A sensor's serial port: read without waiting, reopened after it was unplugged."""

from __future__ import annotations

import time

from drivers.imu.source import ImuError
from drivers.serial_port import REOPEN_EVERY, PortError, SerialPort

REMEDY = "check its cable, its power, and imu.port in robot.toml or --port imu=PATH"


class SerialLink:
    """A serial port that never waits and never raises once it is open."""

    def __init__(self, port: SerialPort, name: str) -> None:
        self._port, self._name = port, name
        self._reopen_at = 0.0
        self.connections = 0
        """How often the port was opened: after each, a sensor may have restarted."""

    def open(self) -> None:
        """Open the port and drop what came before; raises `ImuError` if it does not open."""
        if self._port.is_open:
            return
        try:
            self._port.open()
            self._port.flush()
        except PortError as error:
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
        except PortError:  # unplugged
            self._port.close()
        return data

    def send(self, data: bytes) -> None:
        """Send bytes; those to a lost port are lost."""
        try:
            if self._port.is_open:
                self._port.write(data)
        except PortError:
            self._port.close()

    def _reopen(self) -> None:
        if time.monotonic() >= self._reopen_at:
            self._reopen_at = time.monotonic() + REOPEN_EVERY
            self._port.open()
            self.connections += 1
