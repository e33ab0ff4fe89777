"""Conversion between encoder ticks and joint angles [rad], for all joints of a robot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.state import Integers
from robots import Joint, Robot
from robots.quaternion import Array
from robots.servo import TICKS_PER_TURN

ROUNDING = 0.5 + 1e-9  # ticks by which rounding moves an angle at most


def tick_range(joint: Joint) -> tuple[int, int]:
    """Return the lowest and highest ticks of a joint's range."""
    first, last = sorted(joint.servo.to_ticks(limit) for limit in (joint.lower, joint.upper))
    return first, last


def fits_one_turn(ticks: tuple[int, int], last: int = TICKS_PER_TURN - 1) -> bool:
    """Return whether a range of ticks lies within one turn of a servo, 0 to the last."""
    return ticks[0] >= 0 and ticks[1] <= last


class ServoUnits:
    """`Servo.to_ticks` and `Servo.to_rad` for all joints at once, and goals in whole ticks.

    Ticks count turns of servos: angles go through the couplings of the robot.
    """

    def __init__(self, robot: Robot) -> None:
        servos = [joint.servo for joint in robot.joints]
        self._sign = np.array([float(servo.sign) for servo in servos])
        self._zero = np.array([servo.zero_ticks for servo in servos])
        self._rad_per_tick = np.array([servo.rad_per_tick for servo in servos])
        self._lower, self._upper = robot.lower, robot.upper
        self._transmission = robot.transmission
        # Whole ticks of the joint's own direction inside its range.
        self._first = np.ceil(robot.lower / self._rad_per_tick)
        self._last = np.floor(robot.upper / self._rad_per_tick)

    def to_rad(self, ticks: Integers) -> Array:
        """Convert encoder ticks to joint angles [rad], (..., n)."""
        return self._transmission.to_joint(self.to_actuator(ticks))

    def to_actuator(self, ticks: Integers) -> Array:
        """Convert encoder ticks to angles of the actuators [rad], (..., n)."""
        return np.asarray(self._sign * (ticks - self._zero) * self._rad_per_tick, dtype=float)

    def to_ticks(self, joint_pos: Array) -> Integers:
        """Convert joint angles [rad] to the nearest encoder ticks, (..., n)."""
        turned = self._transmission.to_actuator(joint_pos)
        return np.rint(self._sign * turned / self._rad_per_tick).astype(int) + self._zero

    def to_fractional_ticks(self, joint_pos: Array) -> Array:
        """Convert joint angles [rad] to where the encoders are between their ticks, (..., n)."""
        turned = self._transmission.to_actuator(joint_pos)
        return np.asarray(self._zero + self._sign * turned / self._rad_per_tick, dtype=float)

    def quantize(self, joint_pos: Array) -> Array:
        """Round joint angles [rad] to the encoders' resolution, (..., n)."""
        turned = self._transmission.to_actuator(joint_pos)
        return self._transmission.to_joint(
            self._sign * np.rint(self._sign * turned / self._rad_per_tick) * self._rad_per_tick
        )

    def round_goal(self, joint_pos: Array) -> Array:
        """Round target angles [rad] to whole ticks, (..., n).

        A target inside its joint's range stays inside: at the ends it is rounded inwards. A
        target outside, on its way back, is rounded to the nearest.
        """
        ticks = self._sign * np.rint(self._sign * joint_pos / self._rad_per_tick)
        ticks = np.where(joint_pos >= self._lower, np.maximum(ticks, self._first), ticks)
        ticks = np.where(joint_pos <= self._upper, np.minimum(ticks, self._last), ticks)
        alone = ticks * self._rad_per_tick
        if not self._transmission.couplings:
            return alone
        return np.where(self._transmission.is_coupled, self._round_coupled(joint_pos), alone)

    def _round_coupled(self, joint_pos: Array) -> Array:
        """Round targets of coupled joints to whole ticks of both servos, (..., n).

        Where a joint would leave its range, its pair is drawn inwards first, by what rounding can
        move it.
        """
        rounded, within = self.quantize(joint_pos), self._is_within(joint_pos)
        leaves = within & ~self._is_within(rounded)
        for coupling in self._transmission.couplings:
            pair = coupling.columns
            leaves[..., pair] = leaves[..., pair].any(axis=-1, keepdims=True)
        margin = self._transmission.error_at_joint(ROUNDING * self._rad_per_tick)
        inwards = np.clip(joint_pos, self._lower + margin, self._upper - margin)
        return self.quantize(np.where(leaves & within, inwards, joint_pos))

    def _is_within(self, joint_pos: Array) -> NDArray[np.bool_]:
        return (joint_pos >= self._lower) & (joint_pos <= self._upper)
