"""Orientation from gyro and accelerometer, as on a robot's own board."""

from __future__ import annotations

import imufusion
import mujoco
import numpy as np

from robots.quaternion import Array

GRAVITY = 9.81  # m/s²

# Of the correction of the integrated gyro by the accelerometer.
TIME_CONSTANT = 1.0  # s
# OpenCR's ICM-20648 as the OP3 uses it: 16.4 counts per deg/s, +-2000 deg/s; 16384 counts
# per g, +-2 g (ROBOTIS-OP3 open_cr_module); both in registers of 16 bits.
MOST_COUNTS = 32767
GYRO_STEP = np.radians(1.0 / 16.4)  # rad/s
GYRO_RANGE_DEG = 2000.0  # degrees/s
ACCELEROMETER_STEP = GRAVITY / 16384.0  # m/s²
# The accelerometer is rejected while its vertical differs by this much from the estimate
# (impacts, hard acceleration), unless for so long that the estimate must be wrong.
REJECTION_DEG = 10.0
REJECTION_TIME = 5.0  # s


class OrientationFilter:
    """Fuses gyro and accelerometer into an orientation, by the AHRS of `imufusion`.

    The gyro is integrated; the accelerometer slowly corrects roll and pitch. The yaw is not
    observable: it starts at 0 and drifts.
    """

    def __init__(self, period: float, time_constant: float = TIME_CONSTANT) -> None:
        self._ahrs = imufusion.Ahrs()
        settings = imufusion.AhrsSettings()
        settings.convention = imufusion.CONVENTION_NWU
        settings.gain = 1.0 / time_constant
        settings.gyroscope_range = GYRO_RANGE_DEG
        settings.acceleration_rejection = REJECTION_DEG
        settings.rejection_timeout = REJECTION_TIME
        settings.sample_rate = 1.0 / period
        self._ahrs.set_settings(settings)

    @property
    def orientation(self) -> Array:
        """Return the estimate, sensor frame to world, unit quaternion w x y z."""
        orientation = np.array(self._ahrs.get_quaternion(), dtype=float)
        return orientation / np.sqrt(orientation @ orientation)

    def start(self, accelerometer: Array) -> None:
        """Begin at rest: the vertical from the accelerometer [m/s²], yaw 0."""
        self._ahrs.restart()
        self._ahrs.skip_startup()
        self._ahrs.set_quaternion(upright_from(accelerometer))

    def update(self, gyro: Array, accelerometer: Array, period: float) -> None:
        """Advance the estimate by one sample.

        Args:
            gyro: Angular velocity in the sensor frame [rad/s], shape (3,).
            accelerometer: Specific force in the sensor frame [m/s²], shape (3,).
            period: Time since the last sample [s].
        """
        self._ahrs.set_sample_period(period)
        self._ahrs.update_no_magnetometer(np.degrees(gyro), accelerometer / GRAVITY)


def upright_from(accelerometer: Array) -> Array:
    """Compute the orientation of yaw 0 at which a resting accelerometer reads this.

    The reading is a specific force in the sensor frame [m/s²], shape (3,), not zero.
    """
    x, y, z = accelerometer
    roll = np.arctan2(y, z)
    pitch = np.arctan2(-x, np.hypot(y, z))
    orientation = np.zeros(4)
    mujoco.mju_euler2Quat(orientation, np.array([0.0, pitch, roll]), "zyx")
    return orientation
