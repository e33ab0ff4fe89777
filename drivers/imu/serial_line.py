"""An IMU that sends its numbers as lines of text, in a format given by robot.toml."""

from __future__ import annotations

import math
from functools import reduce
from operator import xor

import numpy as np

from drivers.imu.fusion import GRAVITY
from drivers.imu.source import ImuSample, ImuSource, SerialLink
from drivers.serial_port import SerialPort
from robots.imu import VALUES, ImuSettings, SensorAxes

GYRO_UNITS = {"rad/s": 1.0, "deg/s": math.radians(1.0)}  # rad/s
ACCELEROMETER_UNITS = {"m/s2": 1.0, "g": GRAVITY}  # m/s²
LONGEST_LINE = 512  # bytes; without a line feed for so long, the baud rate is another
# Beyond what MEMS sensors of this class measure: such a line is damaged.
MOST_TURN = math.radians(4000.0)  # rad/s
MOST_FORCE = 32.0 * GRAVITY  # m/s²


class LineFormat:
    """Parses lines of numbers, and rejects any other line."""

    def __init__(self, settings: ImuSettings) -> None:
        self._settings = settings
        words = settings.format.split()
        self._count = len(words)
        self._places = [words.index(value) for value in VALUES]
        gyro = GYRO_UNITS[settings.gyro_unit]
        accelerometer = ACCELEROMETER_UNITS[settings.accelerometer_unit]
        self._scale = np.repeat([gyro, accelerometer], 3)
        self._axes = SensorAxes.of(settings.axes)

    def parse(self, line: bytes) -> ImuSample | None:
        """Convert a line without its line feed; None if it is damaged."""
        text = self._check_sum(line.strip())
        if text is None or not text.isascii() or b"_" in text:  # float() skips an underscore
            return None
        words = text.decode("ascii").split(self._settings.separator)
        if len(words) != self._count:
            return None
        try:
            values = np.array([float(words[place]) for place in self._places]) * self._scale
        except ValueError:
            return None
        gyro, accelerometer = values[:3], values[3:]
        if not (np.abs(gyro).max() <= MOST_TURN and np.abs(accelerometer).max() <= MOST_FORCE):
            return None
        return ImuSample(
            gyro=self._axes.to_site(gyro),
            accelerometer=self._axes.to_site(accelerometer),
            counts=" ".join(words[place] for place in self._places).encode(),
        )

    def _check_sum(self, line: bytes) -> bytes | None:
        """Return a line without its checksum, None if that does not match."""
        if self._settings.checksum == "none":
            return line
        text, star, digits = line.removeprefix(b"$").rpartition(b"*")
        is_right = star and digits.upper() == checksum_of(text)
        return text if is_right else None


def checksum_of(text: bytes) -> bytes:
    """Compute the checksum of NMEA 0183: the XOR of all bytes, two hexadecimal digits."""
    return b"%02X" % reduce(xor, text, 0)


class SerialLineImu(ImuSource):
    """An IMU that sends lines of numbers by itself; the newest complete line counts."""

    def __init__(self, settings: ImuSettings, port: SerialPort) -> None:
        self.name = f"IMU (serial line) on {port.path}"
        self._link, self._format = SerialLink(port, self.name), LineFormat(settings)
        self._rest: bytes | None = None  # of an incomplete line; None before the first line feed

    def open(self) -> None:
        """Open the port."""
        self._link.open()
        self._rest = None

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def poll(self) -> ImuSample | None:
        """Return the newest complete line's sample."""
        connections = self._link.connections
        data = self._link.receive()
        if self._link.connections != connections:
            self._rest = None
        newest = None
        for line in self._cut(data):
            sample = self._format.parse(line)
            self.damaged += sample is None
            newest = sample or newest
        return newest

    def _cut(self, data: bytes) -> list[bytes]:
        """Return the complete lines; bytes before the first line feed are half a line."""
        if self._rest is None:
            _, feed, data = data.partition(b"\n")
            if not feed:
                return []
            self._rest = b""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest if len(rest) <= LONGEST_LINE else None
        self.damaged += self._rest is None
        return [line for line in lines if line.strip()]
