"""Virtual IMUs: what they measure on a simulated robot, and those that send it by themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from drivers.imu.fusion import GRAVITY
from drivers.imu.i2c import I2cChip
from drivers.imu.serial_line import ACCELEROMETER_UNITS, GYRO_UNITS, checksum_of
from drivers.twin.simulation import Simulation
from robots import quaternion
from robots.imu import VALUES, ImuSettings, SensorAxes
from robots.quaternion import Array, slerp


@dataclass(frozen=True, eq=False)
class ImuReading:
    """Measurements of a sensor at one time, in its own axes."""

    time: float
    """Bus time [s]."""
    gyro: Array
    """[rad/s], shape (3,)"""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    orientation: Array
    """Sensor frame to world, w x y z, shape (4,)."""

    @classmethod
    def of(cls, simulation: Simulation, time: float) -> ImuReading:
        """Measure a simulated robot, whose IMU has a line of its own, at a bus time [s]."""
        assert simulation.robot.imu is not None
        axes = SensorAxes.of(simulation.robot.imu.axes)
        site = simulation.model.site(simulation.robot.require_imu_site()).id
        site_in_world = quaternion.from_matrix(simulation.data.site_xmat[site])
        return cls(
            time=time,
            gyro=axes.to_sensor(simulation.imu.gyro),
            accelerometer=axes.to_sensor(simulation.imu.accelerometer),
            orientation=quaternion.multiply(site_in_world, quaternion.from_matrix(axes.matrix)),
        )


def to_counts(value: Array, step: float) -> bytes:
    """Convert a vector to the 16-bit counts of a register, as far as they reach."""
    return np.clip(np.rint(value / step), -32768, 32767).astype("<i2").tobytes()


class VirtualImu(ABC):
    """A virtual IMU on its own line."""

    def __init__(self) -> None:
        self.alive = True
        """False without power: it neither receives nor sends."""
        self.frozen = False
        """True while it repeats its last values."""

    @abstractmethod
    def sense(self, reading: ImuReading) -> None:
        """Take a new measurement, unless it is frozen."""


class VirtualUartImu(VirtualImu):
    """A virtual IMU on a serial line; by default one that sends by itself and ignores bytes."""

    def __init__(self) -> None:
        super().__init__()
        self._pending = b""

    def take(self) -> bytes:
        """Return what it has sent by itself since the last call."""
        pending, self._pending = self._pending, b""
        return pending if self.alive else b""

    def receive(self, data: bytes) -> bytes:  # noqa: ARG002
        """Return the reply to bytes that a client sent."""
        return b""

    def repeat(self) -> bytes:
        """Return what it sends while time stands still."""
        return b""


class VirtualI2cChip(VirtualImu, I2cChip):
    """A chip on an I2C bus; it does not acknowledge without power."""

    path = "virtual I2C"

    def __init__(self) -> None:
        super().__init__()
        self._reading: ImuReading | None = None
        self.restart()

    @abstractmethod
    def restart(self) -> None:
        """Lose power for a moment."""

    @abstractmethod
    def exchange(self, data: bytes, count: int) -> bytes:
        """Take what the host writes, then return as many bytes as it reads."""

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes to the chip, then read some; without power it does not acknowledge."""
        if not self.alive:
            raise OSError(121, "Remote I/O error")
        return self.exchange(data, count)


# All numbers here are the data sheet's own (1.3.5.2), none is the driver's.
HEADER = b"\xaa\xaa"
INDICES = 256
FRAME_PERIOD = 0.01  # s
ANGLE_STEP = np.radians(0.01)  # rad
FORCE_STEP = 1e-3 * GRAVITY  # m/s²
RESERVED = bytes(3)


class VirtualBno08xRvc(VirtualUartImu):
    """Sends a frame every 10 ms of bus time, by its own clock."""

    def __init__(self) -> None:
        super().__init__()
        self._index = 0
        self._due = 0.0
        self._last: ImuReading | None = None
        self._values = b""

    def sense(self, reading: ImuReading) -> None:
        """Send the frames that came due since the last measurement; it turned evenly between."""
        last = self._last or reading
        self._last = reading
        while self._due <= reading.time + 1e-9:
            span = reading.time - last.time
            share = (self._due - last.time) / span if span > 0.0 else 1.0
            orientation = slerp(last.orientation, reading.orientation, share)
            self._pending += self._next_frame(orientation, reading.accelerometer)
            self._due += FRAME_PERIOD

    def repeat(self) -> bytes:
        """Send one more frame, of a robot that rests."""
        if not (self.alive and self._last):
            return b""
        return self._next_frame(self._last.orientation, self._last.accelerometer)

    def _next_frame(self, orientation: Array, accelerometer: Array) -> bytes:
        if not (self.frozen and self._values):
            angles = to_counts(_to_angles(orientation), ANGLE_STEP)
            self._values = angles + to_counts(accelerometer, FORCE_STEP)
        body = bytes([self._index]) + self._values + RESERVED
        self._index = (self._index + 1) % INDICES
        return HEADER + body + bytes([sum(body) % 256])


def _to_angles(orientation: Array) -> Array:
    """Convert an orientation to yaw, pitch and roll, in this order [rad]."""
    w, x, y, z = orientation
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return np.array([yaw, pitch, roll])


class VirtualSerialLine(VirtualUartImu):
    """Sends a line with every measurement, in the format of its settings."""

    def __init__(self, settings: ImuSettings) -> None:
        super().__init__()
        self._settings, self._line = settings, b""

    def sense(self, reading: ImuReading) -> None:
        """Take and send a measurement."""
        if not self.frozen:
            self._line = self._write(reading)
        self._pending += self._line

    def repeat(self) -> bytes:
        """Send the last line again."""
        return self._line if self.alive else b""

    def _write(self, reading: ImuReading) -> bytes:
        settings = self._settings
        gyro = reading.gyro / GYRO_UNITS[settings.gyro_unit]
        accelerometer = reading.accelerometer / ACCELEROMETER_UNITS[settings.accelerometer_unit]
        values = dict[str, float](zip(VALUES, [*gyro, *accelerometer], strict=True))
        words = [f"{values.get(word, 0.0):.6f}" for word in settings.format.split()]
        line = (settings.separator or " ").join(words).encode("ascii")
        if settings.checksum == "nmea":
            line = b"$%s*%s" % (line, checksum_of(line))
        return line + b"\r\n"
