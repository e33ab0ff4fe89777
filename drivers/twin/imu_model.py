"""The twin's IMU: readings of a gyro and an accelerometer on the torso."""

from __future__ import annotations

import mujoco
import numpy as np

from drivers.orientation_filter import ACCELEROMETER_STEP, GYRO_STEP, MOST_COUNTS
from drivers.twin.servo_model import SensorNoise, quantize
from robots.quaternion import Array


class TwinImu:
    """Measures angular velocity and specific force at a site of a simulation.

    Both sensors give their mean over a period, as their low-pass filters do. The gyro's
    is exact: sampled at 125 Hz without a filter, impacts would cost two degrees of tilt.
    """

    def __init__(
        self, model: mujoco.MjModel, site: str, noise: SensorNoise, rng: np.random.Generator
    ) -> None:
        self._model = model
        self._site = model.site(site).id
        self._noise, self._rng = noise, rng
        self._pose = np.zeros(4)  # true orientation at the last sample
        self._velocity = np.zeros(6)  # true velocity there: angular, linear, in the world
        self.gyro = np.zeros(3)
        """Angular velocity in the sensor frame [rad/s], shape (3,)."""
        self.accelerometer = np.zeros(3)
        """Specific force in the sensor frame [m/s²], shape (3,)."""

    def start(self, data: mujoco.MjData) -> None:
        """Start at the simulation's present pose, at rest."""
        self._sample_pose(data)
        self.gyro = self._sense_gyro(np.zeros(3))
        self.accelerometer = self._sense_force(data, np.zeros(3))

    def advance(self, data: mujoco.MjData, period: float) -> None:
        """Take one sample, ``period`` seconds after the last."""
        pose, velocity = self._pose.copy(), self._velocity[3:].copy()
        self._sample_pose(data)
        turn_b = np.zeros(3)
        mujoco.mju_subQuat(turn_b, self._pose, pose)
        self.gyro = self._sense_gyro(turn_b / period)
        self.accelerometer = self._sense_force(data, (self._velocity[3:] - velocity) / period)

    def _sample_pose(self, data: mujoco.MjData) -> None:
        site = mujoco.mjtObj.mjOBJ_SITE
        mujoco.mj_objectVelocity(self._model, data, site, self._site, self._velocity, 0)
        mujoco.mju_mat2Quat(self._pose, data.site_xmat[self._site])

    def _sense_gyro(self, rate_b: Array) -> Array:
        if self._noise.gyro:
            rate_b = rate_b + self._rng.normal(0.0, self._noise.gyro, 3)
        return _measure(rate_b, GYRO_STEP)

    def _sense_force(self, data: mujoco.MjData, acceleration: Array) -> Array:
        R = data.site_xmat[self._site].reshape(3, 3)
        force_b = (acceleration - self._model.opt.gravity) @ R
        if self._noise.accelerometer:
            force_b = force_b + self._rng.normal(0.0, self._noise.accelerometer, 3)
        return _measure(force_b, ACCELEROMETER_STEP)


def _measure(value: Array, step: float) -> Array:
    """Round to whole steps, as many as a register holds."""
    most = MOST_COUNTS * step
    return quantize(np.minimum(np.maximum(value, -most), most), step)
