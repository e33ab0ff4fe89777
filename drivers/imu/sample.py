"""One sample of an IMU."""

from __future__ import annotations

from dataclasses import dataclass

from robots.quaternion import Array


@dataclass(frozen=True, eq=False)
class ImuSample:
    """One sample of an IMU, in the axes of the robot's IMU site."""

    gyro: Array
    """[rad/s], shape (3,)"""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    counts: bytes
    """Raw counts; a frozen sensor repeats them."""
    age: float = 0.0
    """Time since it was measured, when it is delivered [s]."""
    duration: float | None = None
    """Time that the gyro's value stands for, on the sensor's own clock [s]; None: as arrived."""
