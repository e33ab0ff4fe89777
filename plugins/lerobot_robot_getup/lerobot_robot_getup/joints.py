"""Joints as LeRobot counts them: its units of ``<joint>.pos``, and its calibration of servos."""

from __future__ import annotations

import numpy as np
from lerobot.motors import MotorCalibration

from drivers.servo_units import tick_range
from robots import Robot
from robots.quaternion import Array

HOMED = 2047  # ticks of a servo in the posture in which LeRobot homed it, of 4096 a turn


def name_positions(robot: Robot) -> dict[str, type]:
    """Name the joints as LeRobot's features."""
    return {f"{joint}.pos": float for joint in robot.joint_names}


class JointUnits:
    """Converts joint angles to LeRobot's numbers and back.

    Numbers are degrees from the model's zero, or -100 and 100 at the ends of a joint's range.
    """

    def __init__(self, robot: Robot, *, use_degrees: bool) -> None:
        """Make the units of a robot's joints."""
        half = 0.5 * (robot.upper - robot.lower)
        self.zero = np.zeros(robot.n) if use_degrees else robot.lower + half
        self.scale = np.full(robot.n, np.degrees(1.0)) if use_degrees else 100.0 / half

    def from_angles(self, joint_pos: Array) -> Array:
        """Convert angles [rad] to numbers, (n,)."""
        return (joint_pos - self.zero) * self.scale

    def to_angles(self, numbers: Array) -> Array:
        """Convert numbers to angles [rad], (n,)."""
        return numbers / self.scale + self.zero


def find_calibration(robot: Robot) -> dict[str, MotorCalibration]:
    """Compute LeRobot's calibration of a robot that was homed with all joints at 0, by joints.

    LeRobot's positions are ticks plus a homing offset. The ranges are those of the joints;
    ``drive_mode`` is 1 where more ticks turn a joint in its negative direction.
    """
    found = {}
    for joint in robot.actuators:
        low, high = tick_range(joint)
        offset, drive_mode = HOMED - joint.servo.zero_ticks, int(joint.servo.sign < 0)
        found[joint.name] = MotorCalibration(
            joint.servo.id, drive_mode, offset, low + offset, high + offset
        )
    return found
