"""What the torque of a servo does: drives or brakes its joint, and when it has no reserve left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots import Robot
from robots.quaternion import Array

SATURATED = 0.97  # share of the torque-speed line from which no reserve is left
LONG_SATURATION = 1.5  # s on that line, after which a servo's overload protection may trip


@dataclass(frozen=True, eq=False)
class TorqueShares:
    """Torques of servos apart, by what they do; magnitudes [N·m], (..., n)."""

    driving: Array
    """Torque along the joint's motion, or at rest; else 0. A limit holds for it."""
    braking: Array
    """Torque against a motion that comes from outside; else 0.

    By PWM it exceeds the limit: back-EMF adds to the voltage that is limited.
    """


def split_torque(torque: Array, velocity: Array) -> TorqueShares:
    """Tell driving from braking, by torques [N·m] and speeds [rad/s] of actuators, (..., n)."""
    size, drives = np.abs(torque), torque * velocity >= 0.0
    return TorqueShares(driving=np.where(drives, size, 0.0), braking=np.where(drives, 0.0, size))


def find_saturation(
    robot: Robot, torque: Array, velocity: Array, voltage: Array | float
) -> NDArray[np.bool_]:
    """Find where servos have all the torque of their supply [V], (...), as (..., n).

    Torques [N·m] and speeds [rad/s] of the actuators are (..., n). A torque limit below the
    torque-speed line of the supply is not saturation.
    """
    share = np.asarray(voltage)[..., None] / robot.nominal_voltage
    stall = share * robot.max_torque
    along = np.maximum(np.sign(torque) * velocity, 0.0)
    line = np.maximum(stall - robot.torque_speed_slope * along, 0.0)
    return np.abs(torque) >= np.maximum(SATURATED * line, 0.05 * stall)


class LongestRun:
    """Counts for how many rows in a row flags have been set."""

    def __init__(self, *shape: int) -> None:
        self.now, self.longest = np.zeros(shape, dtype=int), np.zeros(shape, dtype=int)

    def add(self, present: NDArray[np.bool_], rows: NDArray[np.int_] | slice = slice(None)) -> None:
        """Add T rows of flags, (T, ...), of the whole shape or of some of its first rows."""
        now, longest = self.now[rows], self.longest[rows]
        for row in present:
            now = np.where(row, now + 1, 0)
            longest = np.maximum(longest, now)
        self.now[rows], self.longest[rows] = now, longest


def measure_saturation(
    robot: Robot, torque: Array, velocity: Array, voltage: Array | float, period: float
) -> Array:
    """Measure for how long servos have all the torque of their supply without a break [s], (N,).

    It is the longest time of any servo of each of N robots. Torques [N·m] and speeds [rad/s] of
    the actuators are sampled every ``period`` [s], (N, T, n); the supplies [V] are a number or
    (N, 1).
    """
    runs = LongestRun(len(torque), robot.n)
    runs.add(np.moveaxis(find_saturation(robot, torque, velocity, voltage), 1, 0))
    return runs.longest.max(axis=1) * period
