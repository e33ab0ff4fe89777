"""Orientation from gyro and accelerometer, as on a robot's own board, with its age."""

from __future__ import annotations

import imufusion
import mujoco
import numpy as np

from drivers.imu.source import ImuSample
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
# An IMU at rest may repeat a sample; one on a body whose joints move cannot, for so long.
FROZEN_CYCLES = 12
MOVING = 1.0  # rad/s of the fastest joint
SINKING_CYCLES = 250  # in which limp limbs may move beside a body at rest, until they lie
# A body at rest: bounds of its IMU samples, and their number.
QUIET_FORCE, QUIET_TURN, QUIET_CYCLES = 0.05, 0.2, 12  # share of gravity, rad/s
# After so long without a sample the gyro has missed too much: the vertical is measured again.
MAX_GAP = 1.0  # s


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


class ImuFusion:
    """Estimates the orientation from an IMU's samples, and the age of the estimate."""

    def __init__(self, period: float) -> None:
        """Prepare for samples that come about every ``period`` seconds."""
        self._filter = OrientationFilter(period)
        self._counts = b""
        self._repeats = self._sinking = 0
        self.gyro = np.zeros(3)
        """Angular velocity in the IMU frame [rad/s], shape (3,)."""
        self.stamp = -np.inf
        """Time of the newest sample [s]."""
        self._changed = -np.inf
        self._is_settled = True
        self._quiet = 0

    @property
    def orientation(self) -> Array:
        """Return the estimate, IMU frame to world, w x y z."""
        return self._filter.orientation

    def start(self, sample: ImuSample, now: float) -> None:
        """Begin at rest; if the body moves, the vertical is measured again as soon as it rests."""
        self._is_settled, self._quiet = _is_quiet(sample), 0
        self._filter.start(sample.accelerometer)
        self.gyro, self.stamp = sample.gyro, now
        self._counts, self._changed = sample.counts, now
        self._repeats = self._sinking = 0

    def update(self, sample: ImuSample, now: float, speed: float, *, is_limp: bool = False) -> None:
        """Advance the estimate by a sample.

        Args:
            sample: Newest sample.
            now: Time at which it was delivered [s].
            speed: Of the fastest joint [rad/s]. A body whose joints move shakes its IMU: one
                that repeats a sample then is broken, and the sample does not count.
            is_limp: Whether no joint has torque. Then an arm may sink beside a torso that
                rests, and an IMU without noise, as simulated ones are, repeats how it rests. For
                `SINKING_CYCLES` with a moving joint, that is no sign that it is broken.
        """
        measured = now - sample.age
        if sample.counts != self._counts:
            self._counts, self._changed = sample.counts, measured
            self._repeats = self._sinking = 0
        elif speed > MOVING and is_limp and _is_still(sample) and self._sinking < SINKING_CYCLES:
            self._sinking += 1
        elif speed > MOVING:
            self._repeats += 1
        if self._repeats >= FROZEN_CYCLES:
            self.stamp = min(self.stamp, self._changed)
            return
        gap = measured - self.stamp
        period = gap if sample.duration is None else sample.duration
        if not self._is_settled:
            self._quiet = self._quiet + 1 if _is_quiet(sample) else 0
            self._is_settled = self._quiet >= QUIET_CYCLES
        if gap > MAX_GAP or self._quiet >= QUIET_CYCLES:
            self._quiet = 0
            self._filter.start(sample.accelerometer)
        elif period > 0.0:
            self._filter.update(sample.gyro, sample.accelerometer, period)
        self.gyro, self.stamp = sample.gyro, measured


def _is_quiet(sample: ImuSample) -> bool:
    force = float(np.sqrt(sample.accelerometer @ sample.accelerometer))
    turn = float(np.sqrt(sample.gyro @ sample.gyro))
    return abs(force / GRAVITY - 1.0) < QUIET_FORCE and turn < QUIET_TURN


def _is_still(sample: ImuSample) -> bool:
    return _is_quiet(sample) and not sample.gyro.any()
