"""Torque of servos: driving or braking, and saturation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots import Robot
from robots.quaternion import Array

SATURATED = 0.97  # share of the torque-speed line from which no reserve is left
LONG_SATURATION = 1.5  # s on that line, after which a servo's overload protection may trip


@dataclass(frozen=True, eq=False)
class SplitTorque:
    """Driving and braking torques of servos; magnitudes [N·m], (..., n)."""

    driving: Array
    """Torque in the direction of motion, or at rest; else 0. Torque limits apply to it."""
    braking: Array
    """Torque against a motion caused from outside; else 0.

    By PWM it exceeds the limit: back-EMF adds to the voltage that is limited.
    """


def split_torque(torque: Array, velocity: Array) -> SplitTorque:
    """Split torques [N·m] at speeds [rad/s] of actuators into driving and braking, (..., n)."""
    size, drives = np.abs(torque), torque * velocity >= 0.0
    return SplitTorque(driving=np.where(drives, size, 0.0), braking=np.where(drives, 0.0, size))


def find_saturation(
    robot: Robot, torque: Array, velocity: Array, voltage: Array | float
) -> NDArray[np.bool_]:
    """Find servos that have all the torque of their supply [V], (...), and may trip, as (..., n).

    Torques [N·m] and speeds [rad/s] of the actuators are (..., n). A torque limit below the
    torque-speed line of the supply is not saturation.
    """
    stall = robot.find_stall(voltage)
    line = find_available(robot, torque, velocity, voltage)
    return robot.trips & (np.abs(torque) >= np.maximum(SATURATED * line, 0.05 * stall))


def find_available(robot: Robot, torque: Array, velocity: Array, voltage: Array | float) -> Array:
    """Compute what servos can do in the direction of their torque [N·m], (..., n).

    It is the torque-speed line of a supply [V], (...), at the actuators' speeds [rad/s], (..., n).
    """
    along = np.maximum(np.sign(torque) * velocity, 0.0)
    return np.maximum(robot.find_stall(voltage) - robot.torque_speed_slope * along, 0.0)


def find_longest(flags: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Count the longest run of samples with set flags (..., T, k), (..., k)."""
    return count_runs(flags).max(axis=-2, initial=0)


def count_runs(
    flags: NDArray[np.bool_], before: NDArray[np.int_] | None = None
) -> NDArray[np.int_]:
    """Count the samples since which flags (..., T, k) have been set without a break.

    Up to the first one they had been set in a row for ``before`` samples, (..., k).
    """
    at = np.arange(1, flags.shape[-2] + 1)[:, np.newaxis]
    begin = np.maximum.accumulate(np.where(flags, 0, at), axis=-2)
    runs = at - begin
    return runs if before is None else runs + np.where(begin == 0, before[..., np.newaxis, :], 0)


def limit_torque(robot: Robot, torque_limit: float | None) -> Array:
    """Return the torque limits of the servos [N·m], (n,)."""
    most = robot.individual.strength * robot.max_torque
    return most if torque_limit is None else np.minimum(most, torque_limit)


def estimate_torque(robot: Robot, current: Array) -> Array:
    """Estimate torques [N·m] from motor currents [A], (..., n).

    The datasheet's stall point gives the ratio; gear friction is not in it.
    """
    return current * robot.torque_per_ampere
