"""Builds the source of a robot's IMU from its settings."""

from __future__ import annotations

from pathlib import Path

from drivers.imu.background import BackgroundImu
from drivers.imu.bno055 import Bno055
from drivers.imu.bno08x_i2c import Bno08xI2c
from drivers.imu.bno08x_rvc import Bno08xRvc
from drivers.imu.i2c import I2cChip, LinuxI2cChip
from drivers.imu.i2c_socket import SocketI2cChip
from drivers.imu.register_link import I2cRegisters, UartRegisters
from drivers.imu.serial_line import SerialLineImu
from drivers.imu.serial_link import SerialLink
from drivers.imu.source import ImuError, ImuSource
from drivers.serial_port import MakePort
from robots.imu import ImuSettings

DEVICES = "/dev/"  # where Linux has its I2C buses


def build_imu_source(settings: ImuSettings, port: str, open_port: MakePort) -> ImuSource:
    """Build the source of an IMU that is not on the servo bus; nothing is opened yet.

    Args:
        settings: Its settings.
        port: Path of its serial port or its I2C bus; empty for that of its settings.
        open_port: Makes a serial port of a path and a baud rate.

    Raises:
        ImuError: if it needs a port and none is named.
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
    """Choose a chip: on an I2C bus of this computer, or on a virtual one at a socket.

    Args:
        settings: Its settings.
        path: Path of its bus; empty for that of its settings.
    """
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
