"""What virtual IMUs share: a reading, power, and the line in front of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from drivers.imu.i2c import I2cChip
from drivers.twin.simulation import Simulation
from robots import quaternion
from robots.imu import SensorAxes
from robots.quaternion import Array


@dataclass(frozen=True, eq=False)
class ImuReading:
    """Measurements of a sensor at one time, in its own axes."""

    time: float
    """Bus time [s]."""
    gyro: Array
    """[rad/s], shape (3,)"""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    orientation: Array
    """Sensor frame to world, w x y z, shape (4,)."""

    @classmethod
    def of(cls, simulation: Simulation, time: float) -> ImuReading:
        """Measure a simulated robot, whose IMU has a line of its own, at a bus time [s]."""
        assert simulation.robot.imu is not None
        axes = SensorAxes.of(simulation.robot.imu.axes)
        site = simulation.model.site(simulation.robot.require_imu_site()).id
        site_in_world = quaternion.from_matrix(simulation.data.site_xmat[site])
        return cls(
            time=time,
            gyro=axes.to_sensor(simulation.imu.gyro),
            accelerometer=axes.to_sensor(simulation.imu.accelerometer),
            orientation=quaternion.multiply(site_in_world, quaternion.from_matrix(axes.matrix)),
        )


def to_counts(value: Array, step: float) -> bytes:
    """Convert a vector to the 16-bit counts of a register, as far as they reach."""
    return np.clip(np.rint(value / step), -32768, 32767).astype("<i2").tobytes()


class VirtualImu(ABC):
    """A virtual IMU on its own line."""

    def __init__(self) -> None:
        self.alive = True
        """False without power: it neither receives nor sends."""
        self.frozen = False
        """True while it repeats its last values."""

    @abstractmethod
    def sense(self, reading: ImuReading) -> None:
        """Take a new measurement, unless it is frozen."""


class VirtualUartImu(VirtualImu):
    """A virtual IMU on a serial line; by default one that sends by itself and ignores bytes."""

    def __init__(self) -> None:
        super().__init__()
        self._pending = b""

    def take(self) -> bytes:
        """Return what it has sent by itself since the last call."""
        pending, self._pending = self._pending, b""
        return pending if self.alive else b""

    def receive(self, data: bytes) -> bytes:  # noqa: ARG002
        """Return the reply to bytes that a client sent."""
        return b""

    def repeat(self) -> bytes:
        """Return what it sends while time stands still."""
        return b""


class VirtualI2cChip(VirtualImu, I2cChip):
    """A chip on an I2C bus; it does not acknowledge without power."""

    path = "virtual I2C"

    def __init__(self) -> None:
        super().__init__()
        self._reading: ImuReading | None = None
        self.restart()

    @abstractmethod
    def restart(self) -> None:
        """Lose power for a moment."""

    @abstractmethod
    def exchange(self, data: bytes, count: int) -> bytes:
        """Take what the host writes, then return as many bytes as it reads."""

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes to the chip, then read some; without power it does not acknowledge."""
        if not self.alive:
            raise OSError(121, "Remote I/O error")
        return self.exchange(data, count)
