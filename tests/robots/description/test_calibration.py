"""A calibration is kept with its robot, and only with its robot."""

import pytest

from robots import RobotError, load_robot
from robots.description.calibration import CALIBRATION_FILE, Calibration, JointCalibration


def save(folder, robot: str = "tiny", **joints) -> None:
    Calibration(robot=robot, joints=joints).save(folder / CALIBRATION_FILE)


def test_what_was_found_replaces_what_was_described(own_robot):
    described = load_robot(own_robot)
    save(own_robot, r_hip=JointCalibration(zero_ticks=1234, sign=1))
    robot = load_robot(own_robot)
    left, right = robot.joints
    assert left == described.joints[0]
    assert (right.servo.zero_ticks, right.servo.sign) == (1234, 1)
    assert right.servo.to_rad(1234) == 0.0


def test_saving_and_loading_gives_the_same(own_robot):
    robot = load_robot(own_robot)
    joints = {"l_hip": JointCalibration(-5, -1), "r_hip": JointCalibration(4095, 1)}
    save(own_robot, **joints)
    assert Calibration.load(own_robot / CALIBRATION_FILE, robot).joints == joints
    assert [path.name for path in own_robot.glob(".*")] == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            'robot = "op3"',
            "it is of robot 'op3', expected 'tiny' (make a new one: getup calibrate)",
        ),
        ("", "robot is missing, expected a text"),
        ("robot = ", "not TOML (Invalid value"),
        ('robot = "tiny"\n[joints.knee]\nzero_ticks = 1\nsign = 1', "unknown joint 'knee'"),
        (
            'robot = "tiny"\n[joints.l_hip]\nzero_ticks = 1.5\nsign = 2',
            "joints.l_hip.zero_ticks is 1.5, expected an integer from -1048575 to 1048575; "
            "joints.l_hip.sign is 2, expected -1 or 1",
        ),
        ('robot = "tiny"\njoints = 3', "joints is 3, expected a table of joint names"),
    ],
)
def test_a_calibration_that_does_not_fit_is_refused_in_one_line(own_robot, text, words):
    (own_robot / CALIBRATION_FILE).write_text(text, "utf-8")
    with pytest.raises(RobotError) as caught:
        load_robot(own_robot)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()
