"""The reading of a virtual IMU."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

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
    def of(cls, simulation: Simulation, axes: SensorAxes, time: float) -> ImuReading:
        """Measure a simulated robot at a bus time [s]."""
        site_in_world, sensor_in_site = np.zeros(4), np.zeros(4)
        site = simulation.model.site(simulation.robot.require_imu_site()).id
        mujoco.mju_mat2Quat(site_in_world, simulation.data.site_xmat[site])
        mujoco.mju_mat2Quat(sensor_in_site, axes.matrix.ravel())
        return cls(
            time=time,
            gyro=axes.to_sensor(simulation.imu.gyro),
            accelerometer=axes.to_sensor(simulation.imu.accelerometer),
            orientation=quaternion.multiply(site_in_world, sensor_in_site),
        )


def to_counts(value: Array, step: float) -> bytes:
    """Convert a vector to the 16-bit counts of a register, as far as they reach."""
    return np.clip(np.rint(value / step), -32768, 32767).astype("<i2").tobytes()
