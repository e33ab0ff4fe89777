"""Joints as LeRobot counts them: there and back, with LeRobot's own arithmetic as the oracle."""

from pathlib import Path

import draccus
import numpy as np
import pytest
from lerobot.motors import Motor, MotorCalibration, MotorNormMode
from lerobot.motors.dynamixel import DynamixelMotorsBus
from lerobot_robot_getup.joints import JointUnits, find_calibration

from robots import Robot, load_robot


def test_angles_survive_the_trip_through_numbers():
    for name in ("op3", "toddlerbot", "wolfgang"):
        robot = load_robot(name)
        angles = np.random.default_rng(0).uniform(robot.lower, robot.upper)
        for use_degrees in (True, False):
            units = JointUnits(robot, use_degrees=use_degrees)
            numbers = units.from_angles(angles)
            assert np.allclose(units.to_angles(numbers), angles, atol=1e-12), name
            assert np.allclose(np.radians(numbers), angles) == use_degrees
        for end, percent in ((robot.lower, -100.0), (robot.upper, 100.0)):
            assert np.allclose(units.from_angles(end), percent)


def test_numbers_of_the_range_are_those_of_lerobots_own_bus(op3: Robot):
    """LeRobot reads the encoder plus the homing offset, and normalizes by the calibration."""
    pytest.importorskip("dynamixel_sdk", reason="LeRobot's bus needs dynamixel-sdk")
    calibration, units = find_calibration(op3), JointUnits(op3, use_degrees=False)
    motors = {
        joint.name: Motor(joint.servo.id, "xm430-w350", MotorNormMode.RANGE_M100_100)
        for joint in op3.joints
    }
    bus = DynamixelMotorsBus("", motors, calibration)
    numbers = [i for i, joint in enumerate(op3.joints) if joint.upper > 0.3]
    assert len(numbers) >= 10
    for i in numbers:
        joint, angles = op3.joints[i], np.zeros(op3.n)
        ticks = joint.servo.to_ticks(0.3)
        angles[i] = joint.servo.to_rad(ticks)
        present = ticks + calibration[joint.name].homing_offset
        (theirs,) = bus._normalize({joint.servo.id: present}).values()
        # LeRobot does not apply drive_mode to Dynamixel servos.
        ours = units.from_angles(angles)[i]
        assert joint.servo.sign * theirs == pytest.approx(ours, abs=0.06), joint.name  # a tick


def test_lerobot_loads_the_calibration_that_a_robot_writes(make, tmp_path: Path):
    for name in ("op3", "toddlerbot", "wolfgang"):
        robot = make(model=name, rise="none")
        assert not robot.is_calibrated
        robot.calibrate()
        assert robot.is_calibrated
        with (tmp_path / "test.json").open() as stream, draccus.config_type("json"):
            loaded = draccus.load(dict[str, MotorCalibration], stream)
        assert loaded == find_calibration(load_robot(name))
        assert list(loaded) == list(load_robot(name).joint_names)
