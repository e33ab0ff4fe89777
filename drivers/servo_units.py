"""Ticks and radians of all joints of a robot: the one place where they cross."""

from __future__ import annotations

import numpy as np

from drivers.state import Integers
from robots import Robot
from robots.quaternion import Array
from robots.servo import RAD_PER_TICK


class ServoUnits:
    """`Servo.to_ticks` and `Servo.to_rad` for all joints at once, and goals in whole ticks."""

    def __init__(self, robot: Robot) -> None:
        servos = [joint.servo for joint in robot.joints]
        self._sign = np.array([float(servo.sign) for servo in servos])
        self._zero = np.array([servo.zero_ticks for servo in servos])
        self._lower, self._upper = robot.lower, robot.upper
        # Whole ticks of the joint's own direction inside its range.
        self._first = np.ceil(robot.lower / RAD_PER_TICK)
        self._last = np.floor(robot.upper / RAD_PER_TICK)

    def to_rad(self, ticks: Integers) -> Array:
        """Convert encoder ticks to joint angles [rad], (..., n)."""
        return np.asarray(self._sign * (ticks - self._zero) * RAD_PER_TICK, dtype=float)

    def to_ticks(self, joint_pos: Array) -> Integers:
        """Convert joint angles [rad] to the nearest encoder ticks, (..., n)."""
        return np.rint(self._sign * joint_pos / RAD_PER_TICK).astype(int) + self._zero

    def quantize(self, joint_pos: Array) -> Array:
        """Round joint angles [rad] to what the encoders tell, (..., n)."""
        return self._sign * np.rint(self._sign * joint_pos / RAD_PER_TICK) * RAD_PER_TICK

    def round_goal(self, joint_pos: Array) -> Array:
        """Round target angles [rad] to whole ticks, (..., n).

        A target inside its joint's range stays inside: at the range's ends it is rounded
        inwards. One that lies beyond, on its way back, is rounded to the nearest.
        """
        ticks = self._sign * np.rint(self._sign * joint_pos / RAD_PER_TICK)
        ticks = np.where(joint_pos >= self._lower, np.maximum(ticks, self._first), ticks)
        ticks = np.where(joint_pos <= self._upper, np.minimum(ticks, self._last), ticks)
        return ticks * RAD_PER_TICK
