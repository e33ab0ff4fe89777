"""A calibration is kept with its robot, and only with its robot."""

import pytest

from robots import RobotError, load_robot
from robots.description.calibration import CALIBRATION_FILE, Calibration, JointCalibration


def save(folder, robot: str = "tiny", **joints) -> None:
    Calibration(robot=robot, joints=joints).save(folder / CALIBRATION_FILE)


def test_what_was_found_is_kept_and_replaces_what_was_described(own_robot):
    described = load_robot(own_robot)
    found = {"r_hip": JointCalibration(zero_ticks=1234, sign=1)}
    save(own_robot, **found)
    assert [path.name for path in own_robot.glob(".*")] == []
    robot = load_robot(own_robot)
    assert Calibration.load(own_robot / CALIBRATION_FILE, robot).joints == found
    left, right = robot.joints
    assert left == described.joints[0]
    assert (right.servo.zero_ticks, right.servo.sign) == (1234, 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('robot = "op3"', "it is of robot 'op3', expected 'tiny' (make a new one: getup calib"),
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
