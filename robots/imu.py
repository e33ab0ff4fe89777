"""IMU settings: kind and line of a robot's IMU, and its axes in the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta

from robots.quaternion import Array
from robots.storage.validation import whole

ImuKind = Literal["board", "bno055", "bno08x", "serial_line"]
if TYPE_CHECKING:
    AxisName = int | str  # of which a type checker cannot see that it is one of these
else:
    AxisName = Literal[-1, 1, "x", "y", "z", "-x", "-y", "-z"]
AxesSetting = Annotated[
    tuple[AxisName, AxisName, AxisName],
    Meta(description='three signs (-1 or 1), or three signed axes such as ["-y", "x", "z"]'),
]

IMU_PORT = "imu"
"""Name of an IMU's own serial port or I2C bus among the ports of a robot."""
SERIAL_BAUD = 115_200  # bit/s of a BNO055 and of a BNO08x in UART-RVC mode (data sheets)
MAX_BAUD = 4_000_000  # bit/s, beyond any USB adapter
MAX_I2C_BUS = 255  # minor numbers of /dev/i2c-N
VALUES = ("gx", "gy", "gz", "ax", "ay", "az")  # that a line of numbers must hold
SKIPPED = "_"  # a word of a line that is not used
I2C_ADDRESSES = {"bno055": 0x28, "bno08x": 0x4A}  # with the address pin low (data sheets)


@dataclass(frozen=True)
class SensorAxes:
    """A signed permutation of axes: takes a vector from a sensor's axes to those of the IMU site.

    Axis i of the site is ``sign[i]`` times axis ``index[i]`` of the sensor.
    """

    index: tuple[int, int, int]
    sign: tuple[int, int, int]

    @classmethod
    def of(cls, setting: tuple[AxisName, AxisName, AxisName]) -> SensorAxes:
        """Read three signs, or three signed names of axes."""
        signs = [name if isinstance(name, int) else -1 if name[0] == "-" else 1 for name in setting]
        places = [
            place if isinstance(name, int) else "xyz".index(name[-1])
            for place, name in enumerate(setting)
        ]
        return cls((places[0], places[1], places[2]), (signs[0], signs[1], signs[2]))

    @property
    def matrix(self) -> Array:
        """Return the matrix that takes sensor axes to site axes, (3, 3)."""
        matrix = np.zeros((3, 3))
        matrix[range(3), self.index] = self.sign
        return matrix

    def to_site(self, vector: Array) -> Array:
        """Turn a vector (3,) from the sensor's axes to the site's."""
        return np.array(self.sign, dtype=float) * vector[list(self.index)]

    def to_sensor(self, vector: Array) -> Array:
        """Turn a vector (3,) from the site's axes to the sensor's."""
        turned = np.empty(3)
        turned[list(self.index)] = np.array(self.sign, dtype=float) * vector
        return turned


@dataclass(frozen=True, kw_only=True)
class ImuSettings:
    """The IMU of a robot: its kind, its line, and its axes in the body."""

    kind: ImuKind
    """``board``: that of `BusSettings.board`, on the servo bus."""
    axes: AxesSetting = ("x", "y", "z")
    """Axes of the robot's IMU site, each as a signed axis of the sensor."""
    connection: Literal["uart", "i2c"] = "uart"
    """Line of a BNO055 or a BNO08x; a BNO08x on a UART is in its UART-RVC mode."""
    port: str = ""
    """Serial port, such as "/dev/ttyAMA0"."""
    baud: Annotated[int, whole(1, MAX_BAUD)] = SERIAL_BAUD
    """[bit/s]"""
    i2c_bus: Annotated[int, whole(0, MAX_I2C_BUS)] = 1
    """N of /dev/i2c-N."""
    i2c_address: Annotated[int, whole(0x08, 0x77)] | None = None
    """Address of the chip; None for that with its address pin low."""
    format: str = " ".join(VALUES)
    """Words of a serial line, in order: gx gy gz ax ay az, and _ for one that is skipped."""
    separator: str | None = None
    """Text between two words; None for white space."""
    gyro_unit: Literal["rad/s", "deg/s"] = "rad/s"
    accelerometer_unit: Literal["m/s2", "g"] = "m/s2"
    checksum: Literal["none", "nmea"] = "none"
    """``nmea``: a line ends with * and the XOR of the bytes before it, two hexadecimal digits."""

    @property
    def has_own_line(self) -> bool:
        """Return whether it has a serial port or an I2C bus of its own."""
        return self.kind != "board"

    @property
    def is_serial(self) -> bool:
        """Return whether it has a serial port of its own."""
        return self.kind == "serial_line" or (
            self.kind in I2C_ADDRESSES and self.connection == "uart"
        )

    @property
    def address(self) -> int:
        """Return the I2C address of its chip."""
        return I2C_ADDRESSES[self.kind] if self.i2c_address is None else self.i2c_address


def find_imu_problems(imu: ImuSettings, *, has_board: bool) -> list[str]:
    """Find values of an ``[imu]`` table that contradict each other."""
    problems = find_axes_problems("imu.axes", imu.axes)
    if imu.kind == "board" and not has_board:
        problems.append("imu.kind is 'board', expected a [bus.board] table with it")
    words = [word for word in imu.format.split() if word != SKIPPED]
    if imu.format and sorted(words) != sorted(VALUES):
        problems.append(
            f"imu.format is {imu.format!r}, expected {' '.join(VALUES)} once each, in any order, "
            f"and {SKIPPED} for each word to skip"
        )
    return problems


def find_axes_problems(key: str, setting: tuple[AxisName, AxisName, AxisName]) -> list[str]:
    """Find axis names that are not a rotation; three signs need no check."""
    if 0 in setting or all(isinstance(name, int) for name in setting):  # 0: reported already
        return []
    problem = f"{key} is {list(setting)}, expected"
    if any(isinstance(name, int) for name in setting):
        return [f"{problem} three signs or three axes, not both"]
    axes = SensorAxes.of(setting)
    if len(set(axes.index)) < 3:
        return [f"{problem} each of x, y and z once"]
    if np.linalg.det(axes.matrix) < 0.0:
        return [f"{problem} right-handed axes: turn the sign of one of them"]
    return []
