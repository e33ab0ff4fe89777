"""From gyro and accelerometer to orientation, as on a robot's own board."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.rotation import IDENTITY, Array

GRAVITY = 9.81  # m/s²

# Seconds in which the accelerometer pulls the integrated gyro towards the vertical.
TIME_CONSTANT = 1.0
# Share of gravity by which the accelerometer's length may differ before it is not heard.
SHAKE_TOLERANCE = 0.1

_UP = np.array([0.0, 0.0, 1.0])
_INVERSE = np.array([1.0, -1.0, -1.0, -1.0])


class OrientationFilter:
    """Fuse gyro and accelerometer into an orientation (complementary filter of [Mahony08]).

    The gyro is integrated; the accelerometer, when it measures little more than gravity,
    slowly turns the result until both agree on the vertical. Nothing knows the yaw: it
    starts at 0 and drifts.

    [Mahony08] R. Mahony, T. Hamel, J.-M. Pflimlin: Nonlinear complementary filters on the
    special orthogonal group. IEEE Transactions on Automatic Control 53 (5), 2008.
    """

    def __init__(self, time_constant: float = TIME_CONSTANT) -> None:
        self.time_constant = time_constant
        self._orientation = IDENTITY.copy()
        self._up_b = np.zeros(3)
        self._turn_b = np.zeros(3)

    @property
    def orientation(self) -> Array:
        """Return the estimate, sensor frame to world, unit quaternion w x y z."""
        return self._orientation.copy()

    def start(self, accelerometer: Array) -> None:
        """Begin at rest: the vertical from the accelerometer [m/s²], yaw 0."""
        self._orientation = upright_from(accelerometer)

    def update(self, gyro: Array, accelerometer: Array, period: float) -> None:
        """Advance the estimate by one sample.

        Args:
            gyro: Angular velocity in the sensor frame [rad/s], shape (3,).
            accelerometer: Specific force in the sensor frame [m/s²], shape (3,).
            period: Time since the last sample [s].
        """
        force = float(np.sqrt(accelerometer @ accelerometer))
        trust = 1.0 - abs(force / GRAVITY - 1.0) / SHAKE_TOLERANCE
        turn_b = gyro
        if trust > 0.0:
            mujoco.mju_rotVecQuat(self._up_b, _UP, self._orientation * _INVERSE)
            mujoco.mju_cross(self._turn_b, accelerometer, self._up_b)
            turn_b = gyro + self._turn_b * (trust / (force * self.time_constant))
        mujoco.mju_quatIntegrate(self._orientation, turn_b, period)


def upright_from(accelerometer: Array) -> Array:
    """Compute the orientation of yaw 0 at which a resting accelerometer reads this.

    Args:
        accelerometer: Specific force in the sensor frame [m/s²], shape (3,), not zero.
    """
    x, y, z = accelerometer
    roll = np.arctan2(y, z)
    pitch = np.arctan2(-x, np.hypot(y, z))
    orientation = np.zeros(4)
    mujoco.mju_euler2Quat(orientation, np.array([0.0, pitch, roll]), "zyx")
    return orientation
