"""A virtual IMU that writes lines of numbers."""

from __future__ import annotations

from drivers.imu.serial_line import ACCELEROMETER_UNITS, GYRO_UNITS, checksum_of
from drivers.virtual_bus.imu.virtual_imu import ImuReading, VirtualUartImu
from robots.imu import VALUES, ImuSettings


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
