"""Bus settings: ports, baud rate and board of a robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from robots.imu import AxesSetting
from robots.storage.validation import Names, positive, whole

MAIN_PORT = "main"  # name of the port when all joints share one
WATCHDOG = 0.1  # s of silence after which servos stop by themselves; a dozen cycles


BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""Baud rates of X-series servos [bit/s] (e-manual, Baud Rate)."""
if TYPE_CHECKING:
    BaudRate = int  # of which a type checker cannot see that it is one of these
else:
    BaudRate = Literal[BAUD_RATES]
MAX_ADDRESS = 0xFFFF  # of a register (Protocol 2.0)
MAX_WATCHDOG = 2.54  # s, 127 steps of 20 ms (e-manual, Bus Watchdog)


@dataclass(frozen=True, kw_only=True)
class BoardSettings:
    """A controller board on the servo bus that carries the IMU.

    Its control table is known by the model's name, or the addresses and scales of its gyro and
    its accelerometer are given: three axes each, x first, signed, two bytes, little endian.
    """

    model: str = ""
    """Name of its control table; empty if the addresses below are given."""
    id: Annotated[int, whole(0, 252)]
    imu_axes: AxesSetting
    """Axes of the robot's IMU site, each as a signed axis of the IMU."""
    powers_servos: bool = False
    """True if servos have no power until the board switches it on."""
    port: str = ""
    """Name of the port on which it replies; in a robot.toml the first if left out."""
    gyro_address: Annotated[int, whole(0, MAX_ADDRESS)] = 0
    accelerometer_address: Annotated[int, whole(0, MAX_ADDRESS)] = 0
    gyro_scale: Annotated[float, positive(1.0, "rad/s")] = 0.0
    """[rad/s] a count"""
    accelerometer_scale: Annotated[float, positive(1.0, "m/s²")] = 0.0
    """[m/s²] a count"""


@dataclass(frozen=True, kw_only=True)
class BusSettings:
    """Ports, baud rate and board of a robot's servos."""

    baud: BaudRate
    """[bit/s]"""
    watchdog: Annotated[float, positive(MAX_WATCHDOG, "s")] = WATCHDOG
    """Silence after which servos under torque stop by themselves [s]."""
    ports: Annotated[
        dict[str, Names], Meta(description="a table of port names and joints", min_length=1)
    ] = field(default_factory=dict)
    """Names of the joints on each serial port; in a robot.toml one for all if left out."""
    board: BoardSettings | None = None
