"""Every kind of IMU beside its virtual sensor, which is turned by hand."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from drivers.imu.build import build_i2c_source, build_imu_source
from drivers.imu.fusion import GRAVITY
from drivers.imu.source import ImuSample
from drivers.serial_port import PortLostError, PortRefusedError
from drivers.virtual_bus.imu.virtual_imu import ImuReading, VirtualUartImu
from drivers.virtual_bus.virtual_robot import build_virtual_imu
from robots import ImuSettings, quaternion
from robots.imu import SensorAxes

PERIOD = 0.008
MOST_CYCLES = 1000  # until the first sample: setting up a chip takes some
AXES = ("-y", "x", "z")  # a quarter turn about z

KINDS = {
    "serial line": ImuSettings(kind="serial_line", axes=AXES),
    "described line": ImuSettings(
        kind="serial_line",
        axes=AXES,
        format="_ az ay ax _ gx gy gz",
        separator=",",
        gyro_unit="deg/s",
        accelerometer_unit="g",
        checksum="nmea",
    ),
    "BNO055 on a UART": ImuSettings(kind="bno055", axes=AXES),
    "BNO055 on I2C": ImuSettings(kind="bno055", axes=AXES, connection="i2c"),
    "BNO08x UART-RVC": ImuSettings(kind="bno08x", axes=AXES),
    "BNO08x on I2C": ImuSettings(kind="bno08x", axes=AXES, connection="i2c"),
}


class SensorPort:
    """A serial port in memory with a virtual sensor at its other end."""

    def __init__(self, sensor: VirtualUartImu) -> None:
        self.path = "memory"
        self.is_open = self.unplugged = False
        self.spoil: Callable[[bytes], bytes] = lambda data: data
        """Modifies what the sensor sends."""
        self.rate = self.left = 10**6
        """Bytes that arrive in a cycle, and those that still do in this one."""
        self._sensor, self._came = sensor, b""

    def open(self) -> None:
        if self.unplugged:
            raise PortRefusedError(self.path, "does not exist")
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def read(self, deadline: float) -> bytes:
        del deadline
        self._check()
        if sent := self._sensor.take():
            self._came += self.spoil(sent)
        data, self._came = self._came[: self.left], self._came[self.left :]
        self.left -= len(data)
        return data

    def write(self, data: bytes) -> None:
        self._check()
        self._came += self.spoil(self._sensor.receive(data))

    def flush(self) -> int:
        return len(self.read(0.0))

    def _check(self) -> None:
        if self.unplugged or not self.is_open:
            raise PortLostError(self.path)


class ImuBench:
    """A source, the virtual sensor that it reads, and the body on which that sits."""

    def __init__(self, settings: ImuSettings) -> None:
        self.sensor = build_virtual_imu(settings)
        self.time, self.orientation = 0.0, np.array([1.0, 0.0, 0.0, 0.0])
        self._axes = SensorAxes.of(settings.axes)
        self.port: SensorPort | None = None
        if settings.is_serial:
            self.port = SensorPort(self.sensor)
            self.source = build_imu_source(settings, "memory", lambda *_: self.port)
        else:
            self.source = build_i2c_source(settings, self.sensor)
        self._sense(np.zeros(3))
        self.source.open()

    def cycle(self, *rate: float) -> ImuSample | None:
        """Turn the body at a rate in its own axes [rad/s] for a period; poll the source."""
        turn = np.array(rate or (0.0, 0.0, 0.0))
        mujoco.mju_quatIntegrate(self.orientation, turn, PERIOD)
        self.time += PERIOD
        if self.port is not None:
            self.port.left = self.port.rate
        self._sense(turn)
        self.source.request(self.time)
        return self.source.poll()

    def first(self) -> ImuSample:
        """Run cycles at rest until there is a sample."""
        for _ in range(MOST_CYCLES):
            if (sample := self.cycle()) is not None:
                return sample
        raise AssertionError(f"no sample in {MOST_CYCLES} cycles")

    def _sense(self, gyro: np.ndarray) -> None:
        up, sensor_in_site = np.array([0.0, 0.0, GRAVITY]), np.zeros(4)
        mujoco.mju_mat2Quat(sensor_in_site, self._axes.matrix.ravel())
        force = quaternion.rotate(quaternion.inverse(self.orientation), up)
        self.sensor.sense(
            ImuReading(
                time=self.time,
                gyro=self._axes.to_sensor(gyro),
                accelerometer=self._axes.to_sensor(force),
                orientation=quaternion.multiply(self.orientation, sensor_in_site),
            )
        )
