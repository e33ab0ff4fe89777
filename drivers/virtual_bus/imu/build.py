"""Builds the virtual IMU of a robot."""

from __future__ import annotations

from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c
from drivers.virtual_bus.imu.bno08x_rvc import VirtualBno08xRvc
from drivers.virtual_bus.imu.serial_line import VirtualSerialLine
from robots.imu import ImuSettings

AnyVirtualImu = VirtualBno055 | VirtualBno08xI2c | VirtualBno08xRvc | VirtualSerialLine


def build_virtual_imu(settings: ImuSettings) -> AnyVirtualImu:
    """Build the virtual counterpart of an IMU that is not on the servo bus."""
    if settings.kind == "bno055":
        return VirtualBno055()
    if settings.kind == "bno08x":
        return VirtualBno08xRvc() if settings.is_serial else VirtualBno08xI2c()
    return VirtualSerialLine(settings)
