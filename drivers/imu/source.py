"""Interface between a robot's backend and its IMU, of any make and on any line."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

from drivers.errors import SetupError
from drivers.serial_port import REOPEN_EVERY, PortError, SerialPort
from robots.quaternion import Array

FIRST_SAMPLE = 1.0  # s to wait for the first sample; a BNO055 boots in 0.65 s (data sheet)
POLL_STEP = 0.002  # s between two looks meanwhile
REMEDY = "check its cable, its power, and imu.port in robot.toml or --port imu=PATH"


class ImuError(SetupError):
    """An IMU cannot be used."""

    def __init__(self, name: str, text: str, remedy: str) -> None:
        super().__init__(f"{name}: {text}; {remedy}")
        self.name, self.text, self.remedy = name, text, remedy


@dataclass(frozen=True, eq=False)
class ImuSample:
    """One sample of an IMU, in the axes of the robot's IMU site."""

    gyro: Array
    """[rad/s], shape (3,)"""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    counts: bytes
    """Raw counts; a frozen sensor repeats them."""
    age: float = 0.0
    """Time since it was measured, when it is delivered [s]."""
    duration: float | None = None
    """Time that the gyro's value stands for, on the sensor's own clock [s]; None: as arrived."""


class ImuSource(Protocol):
    """An IMU that delivers samples.

    `request` and `poll` belong to the control cycle: they never wait and never raise. A silent or
    unplugged sensor delivers nothing, and damaged bytes never become a sample; whether the
    sensor is frozen is for `ImuFusion` to judge.
    """

    name: str
    """In messages."""
    note: str = ""
    """What is special about its samples, in words; empty for nothing."""
    damaged: int = 0
    """How many messages were dropped because they were damaged."""

    def open(self) -> None:
        """Open and configure it; harmless if it is open.

        Raises:
            ImuError: if its line cannot be used, or another chip replies.
        """

    def close(self) -> None:
        """Close its line; harmless if it is closed."""

    def request(self, now: float) -> None:
        """Begin a cycle at a time [s]: ask a sensor that does not send by itself."""

    def poll(self) -> ImuSample | None:
        """Return the newest sample that arrived since the last call, None for none."""
        ...

    def measure(self) -> ImuSample | None:
        """Wait for one sample, outside of the control cycle; None if the IMU is silent."""
        until = time.monotonic() + FIRST_SAMPLE
        while True:
            now = time.monotonic()
            self.request(now)
            if (sample := self.poll()) is not None or now > until:
                return sample
            time.sleep(POLL_STEP)


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
