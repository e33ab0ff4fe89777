"""The servo bus of a robot: what hangs on which port, at what speed."""

from __future__ import annotations

from dataclasses import dataclass

WATCHDOG = 0.1  # s of silence after which servos stop by themselves; a dozen cycles


@dataclass(frozen=True, kw_only=True)
class BoardSettings:
    """A controller board on the servo bus that carries the IMU."""

    model: str
    """Name of its control table."""
    id: int
    imu_axes: tuple[int, int, int]
    """Sign that takes each raw axis of the IMU to the robot's IMU site."""
    powers_servos: bool
    """True when servos have no power until the board switches it on."""
    port: str
    """Name of the port it answers on."""


@dataclass(frozen=True, kw_only=True)
class PortSettings:
    """One serial port and the joints on it."""

    name: str
    joints: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class BusSettings:
    """How a robot's servos are reached."""

    baud: int
    """[bit/s]"""
    watchdog: float
    """Silence after which servos under torque stop by themselves [s]."""
    ports: tuple[PortSettings, ...]
    board: BoardSettings | None
