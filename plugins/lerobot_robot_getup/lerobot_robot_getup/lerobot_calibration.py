"""LeRobot's calibration of a robot's servos, from its description and back.

LeRobot counts from homing offsets: the position of a Dynamixel servo is that of its encoder plus
the offset, and in the posture in which it was homed it is at `HOMED`, half a turn.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import msgspec
from lerobot.motors import MotorCalibration

from drivers.service.calibrate import JointMeasurement
from drivers.servo_units import tick_range
from humanoid_getup.jobs.errors import BadInputError
from robots import Joint, Robot
from robots.quaternion import Array
from robots.storage.files import write_atomically
from robots.storage.validation import Sign

HOMED = 2047
"""Position of a servo in the posture in which it was homed, of 4096 ticks a turn."""
Directions = Literal["file", "robot"]
"""Whose directions are taken where a file and the description of a robot differ."""


def find_calibration(robot: Robot) -> dict[str, MotorCalibration]:
    """Compute LeRobot's calibration of a robot that was homed with all joints at 0, by joints.

    The ranges are those of the joints; ``drive_mode`` is 1 where more ticks turn a joint in its
    negative direction.
    """
    return {joint.name: _calibrate(joint) for joint in robot.actuators}


def _calibrate(joint: Joint) -> MotorCalibration:
    low, high = tick_range(joint)
    offset = HOMED - joint.servo.zero_ticks
    return MotorCalibration(
        id=joint.servo.id,
        drive_mode=int(joint.servo.sign < 0),
        homing_offset=offset,
        range_min=low + offset,
        range_max=high + offset,
    )


def save_calibration(calibration: Mapping[str, MotorCalibration], path: Path) -> None:
    """Write a file that LeRobot loads."""
    joints = {name: asdict(motor) for name, motor in calibration.items()}
    write_atomically(path, json.dumps(joints, indent=4) + "\n")


def load_calibration(path: Path) -> dict[str, MotorCalibration]:
    """Load a file that LeRobot wrote.

    Raises:
        BadInputError: naming what does not fit.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=dict[str, MotorCalibration])
    except OSError as error:
        raise BadInputError(f"{path}: {error.strerror}") from error
    except msgspec.DecodeError as error:
        raise BadInputError(
            f"{path}: {error}, expected LeRobot's calibration: a JSON object of joints with id, "
            "drive_mode, homing_offset, range_min and range_max"
        ) from error


def measure_joints(
    robot: Robot,
    calibration: Mapping[str, MotorCalibration],
    homed_at: Array,
    directions: Directions | None = None,
) -> list[JointMeasurement]:
    """Convert LeRobot's calibration to zeros and directions of a robot's servos.

    Args:
        robot: Robot whose joints they are.
        calibration: LeRobot's calibration, by joints.
        homed_at: Joint angles at which the servos were homed [rad], (n,).
        directions: Whose directions are taken; None to refuse those that differ.

    Raises:
        BadInputError: naming every joint that does not fit.
    """
    if problems := _find_problems(robot, calibration, directions):
        raise BadInputError("; ".join(problems))
    turned = dict(zip(robot.joint_names, robot.transmission.to_actuator(homed_at), strict=True))
    return [
        _measure(joint, calibration[joint.name], float(turned[joint.name]), directions)
        for joint in robot.actuators
        if joint.name in calibration
    ]


def _measure(
    joint: Joint, motor: MotorCalibration, angle: float, directions: Directions | None
) -> JointMeasurement:
    sign: Sign = joint.servo.sign if directions == "robot" else _sign_of(motor)
    zero = HOMED - motor.homing_offset - round(sign * angle / joint.servo.rad_per_tick)
    return JointMeasurement(joint, zero, sign)


def _find_problems(
    robot: Robot, calibration: Mapping[str, MotorCalibration], directions: Directions | None
) -> list[str]:
    unknown = [name for name in calibration if name not in robot.joint_names]
    problems = _name_unknown(unknown, robot)
    for joint in robot.actuators:
        motor, servo = calibration.get(joint.name), joint.servo
        if motor is None:
            continue
        if motor.id != servo.id:
            problems.append(f"joint '{joint.name}': id is {motor.id}, expected {servo.id}")
        if motor.range_min >= motor.range_max:
            problems.append(
                f"joint '{joint.name}': range_min is {motor.range_min} ticks, expected less than "
                f"range_max, {motor.range_max} ticks"
            )
        if directions is None and _sign_of(motor) != servo.sign:
            problems.append(
                f"joint '{joint.name}': drive_mode is {motor.drive_mode}, expected "
                f"{int(servo.sign < 0)} as robot '{robot.name}' turns it, or --directions "
                "file|robot for those to take"
            )
    return problems


def _name_unknown(unknown: Sequence[str], robot: Robot) -> list[str]:
    if not unknown:
        return []
    named = ", ".join(map(repr, unknown))
    return [f"unknown joint {named}, expected those of robot '{robot.name}'"]


def _sign_of(motor: MotorCalibration) -> Sign:
    return -1 if motor.drive_mode else 1
