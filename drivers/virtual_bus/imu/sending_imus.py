"""Virtual IMUs that send by themselves: a BNO08x in its UART-RVC mode, and lines of numbers."""

from __future__ import annotations

import numpy as np

from drivers.imu.fusion import GRAVITY
from drivers.imu.serial_line import ACCELEROMETER_UNITS, GYRO_UNITS, checksum_of
from drivers.virtual_bus.imu.virtual_imu import ImuReading, VirtualUartImu, to_counts
from robots.imu import VALUES, ImuSettings
from robots.quaternion import Array, slerp

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
