"""LeRobot's calibration of a robot's servos, from its description and back.

LeRobot counts from homing offsets: a Dynamixel servo's position is that of its encoder plus the
offset, and the posture in which it was homed is at `HOMED`, half a turn. Ours is at joint angle 0.
"""

from __future__ import annotations

from lerobot.motors import MotorCalibration

from drivers.servo_units import tick_range
from robots import Robot

HOMED = 2047
"""Position of a homed servo, in LeRobot's arithmetic of 4096 ticks a turn."""


def find_calibration(robot: Robot) -> dict[str, MotorCalibration]:
    """Compute LeRobot's calibration of a robot, by joints."""
    calibration: dict[str, MotorCalibration] = {}
    for joint in robot.joints:
        servo, (low, high) = joint.servo, tick_range(joint)
        offset = HOMED - servo.zero_ticks
        calibration[joint.name] = MotorCalibration(
            id=servo.id,
            drive_mode=int(servo.sign < 0),
            homing_offset=offset,
            range_min=low + offset,
            range_max=high + offset,
        )
    return calibration
