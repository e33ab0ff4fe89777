"""Units of joints: there and back, and LeRobot's own arithmetic as the oracle."""

import numpy as np
import pytest

pytest.importorskip("lerobot.robots", reason="needs LeRobot", exc_type=ImportError)

from lerobot.motors import Motor, MotorNormMode
from lerobot.motors.dynamixel import DynamixelMotorsBus
from lerobot_robot_getup.joint_units import JointUnits
from lerobot_robot_getup.lerobot_calibration import find_calibration

from robots import Robot, load_robot


@pytest.mark.parametrize("use_degrees", [True, False])
@pytest.mark.parametrize("name", ["op3", "toddlerbot", "wolfgang"])
def test_angles_survive_the_trip_through_numbers(name: str, use_degrees: bool):
    robot = load_robot(name)
    units = JointUnits.of(robot, use_degrees=use_degrees)
    angles = np.random.default_rng(0).uniform(robot.lower, robot.upper)
    numbers = units.from_angles(angles)
    assert np.allclose(units.to_angles(numbers), angles, atol=1e-12)
    if use_degrees:
        assert np.allclose(np.radians(numbers), angles)


def test_the_ends_of_a_range_are_a_hundred(op3: Robot):
    units = JointUnits.of(op3, use_degrees=False)
    assert np.allclose(units.from_angles(op3.lower), -100.0)
    assert np.allclose(units.from_angles(op3.upper), 100.0)


def test_numbers_of_the_range_are_those_of_lerobots_own_bus(op3: Robot):
    """LeRobot reads the encoder plus the homing offset, and normalizes by the calibration."""
    pytest.importorskip("dynamixel_sdk", reason="LeRobot's bus needs dynamixel-sdk")
    calibration = find_calibration(op3)
    motors = {
        joint.name: Motor(joint.servo.id, "xm430-w350", MotorNormMode.RANGE_M100_100)
        for joint in op3.joints
    }
    bus = DynamixelMotorsBus("", motors, calibration)
    units = JointUnits.of(op3, use_degrees=False)
    ticks = {joint.name: joint.servo.to_ticks(0.3) for joint in op3.joints if joint.upper > 0.3}
    assert len(ticks) >= 10
    for joint in op3.joints:
        if joint.name not in ticks:
            continue
        i = op3.joint_names.index(joint.name)
        angles = np.zeros(op3.n)
        angles[i] = joint.servo.to_rad(ticks[joint.name])
        present = ticks[joint.name] + calibration[joint.name].homing_offset
        (theirs,) = bus._normalize({joint.servo.id: present}).values()
        ours = units.from_angles(angles)[i]
        # LeRobot does not apply drive_mode to Dynamixel servos.
        assert joint.servo.sign * theirs == pytest.approx(ours, abs=0.06)  # a tick
