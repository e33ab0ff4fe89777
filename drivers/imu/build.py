"""Builds the source of a robot's IMU from its settings."""

from __future__ import annotations

from drivers.imu.serial_line import SerialLineImu
from drivers.imu.serial_link import OpenPort
from drivers.imu.source import ImuError, ImuSource
from robots.imu import ImuSettings


def build_imu_source(settings: ImuSettings, port: str, open_port: OpenPort) -> ImuSource:
    """Build the source of an IMU that is not on the servo bus; nothing is opened yet.

    Args:
        settings: Its settings.
        port: Path of its serial port; empty for that of its settings.
        open_port: Makes a serial port of a path and a baud rate.

    Raises:
        ImuError: if it needs a port and none is named.
    """
    path = port or settings.port
    if settings.is_serial and not path:
        remedy = "set imu.port in robot.toml, or give --port imu=PATH"
        raise ImuError(f"IMU ({settings.kind})", "its serial port is not named", remedy)
    return SerialLineImu(settings, open_port(path, settings.baud))
