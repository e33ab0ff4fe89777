"""Builds the source of a robot's IMU from its settings."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path

from drivers.imu.bno055 import Bno055, I2cRegisters, UartRegisters
from drivers.imu.bno08x import Bno08xI2c, Bno08xRvc
from drivers.imu.i2c import I2cChip, LinuxI2cChip, SocketI2cChip
from drivers.imu.serial_line import SerialLineImu
from drivers.imu.source import ImuError, ImuSample, ImuSource, SerialLink
from drivers.real_time_class import LOOP_PRIORITY, enter_real_time_class
from drivers.serial_port import MakePort
from robots.imu import ImuSettings

DEVICES = "/dev/"  # where Linux has its I2C buses
INTERVAL = 0.004  # s between two reads, twice as often as the fastest control cycles


def build_imu_source(settings: ImuSettings, port: str, open_port: MakePort) -> ImuSource:
    """Build the source of an IMU that is not on the servo bus; nothing is opened yet.

    ``port`` is the path of its serial port or I2C bus, empty for that of its settings: without
    any, an `ImuError` is raised.
    """
    if not settings.is_serial:
        return BackgroundImu(build_i2c_source(settings, choose_chip(settings, port)))
    path = port or settings.port
    if not path:
        remedy = "set imu.port in robot.toml, or give --port imu=PATH"
        raise ImuError(f"IMU ({settings.kind})", "its serial port is not named", remedy)
    serial = open_port(path, settings.baud)
    if settings.kind == "bno055":
        name = f"IMU BNO055 on {path}"
        return Bno055(settings, UartRegisters(SerialLink(serial, name)), name)
    if settings.kind == "bno08x":
        return Bno08xRvc(settings, serial)
    return SerialLineImu(settings, serial)


def choose_chip(settings: ImuSettings, path: str) -> I2cChip:
    """Choose a chip: on an I2C bus of this computer, or on a virtual one at a socket's path."""
    if not path:
        return LinuxI2cChip(settings.i2c_bus, settings.address)
    is_device = path.startswith(DEVICES) or Path(path).is_char_device()
    return (LinuxI2cChip if is_device else SocketI2cChip)(path, settings.address)


def build_i2c_source(settings: ImuSettings, chip: I2cChip) -> ImuSource:
    """Build the source of a chip on I2C, read where it is polled."""
    if settings.kind == "bno08x":
        return Bno08xI2c(settings, chip)
    name = f"IMU BNO055 on {chip.path}"
    return Bno055(settings, I2cRegisters(chip, name), name)


class BackgroundImu(ImuSource):
    """Delivers the newest sample that its thread has read.

    An I2C transfer waits until it is done: 0.7 ms for a sample at 400 kbit/s, and for as long as
    the adapter's timeout if the bus hangs. That must not delay the servos.
    """

    def __init__(self, source: ImuSource) -> None:
        self._source, self.name, self.note = source, source.name, source.note
        self._lock = threading.Lock()
        self._newest: tuple[ImuSample, float] | None = None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def damaged(self) -> int:
        """Return how many messages were dropped because they were damaged."""
        return self._source.damaged

    def open(self) -> None:
        """Open the sensor, and begin to read it."""
        if self._thread is not None:
            return
        self._source.open()
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name=self.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the reading, and close the sensor."""
        if self._thread is not None:
            self._stopping.set()
            self._thread.join()
            self._thread = None
        self._source.close()
        self._newest = None

    def poll(self) -> ImuSample | None:
        """Return the newest sample with its age."""
        with self._lock:
            newest, self._newest = self._newest, None
        if newest is None:
            return None
        sample, at = newest
        return replace(sample, age=sample.age + time.monotonic() - at)

    def _run(self) -> None:
        enter_real_time_class(LOOP_PRIORITY)  # a sample must not be late where the loop is not
        while not self._stopping.wait(INTERVAL):
            now = time.monotonic()
            self._source.request(now)
            sample = self._source.poll()
            if sample is not None:
                with self._lock:
                    self._newest = sample, now
