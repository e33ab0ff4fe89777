"""Loading robots by name and from a folder: contradictions are reported once, with calibration."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paths import TINY
from spoiling import spoil

from drivers import Command, Twin
from robots import Robot, RobotError, load_robot
from robots.body.statics import Statics
from robots.description.calibration import CALIBRATION_FILE, Calibration, JointCalibration
from robots.description.schema import RobotTable, read_description
from robots.description.servo_catalog import servo_models
from robots.torque_limit import KP


def test_a_name_means_the_packages_robot_whatever_folder_is_here(own_robot, monkeypatch):
    own_robot.rename(own_robot.parent / "op3")
    monkeypatch.chdir(own_robot.parent)
    assert load_robot("op3").name == "op3"
    assert load_robot("./op3").name == load_robot(Path("op3")).name == "tiny"


def test_a_robot_stands_on_the_lower_of_its_soles(tiny, own_robot):
    # Legs of 0.1 m, neck 0.05 m over the hips.
    assert tiny.standing.position == pytest.approx([0.0, 0.0, 0.1])
    assert tiny.standing.orientation == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert tiny.standing_neck_height == pytest.approx(0.15)
    site = '<site name="r_sole" pos="0 0 -0.1"/>'
    spoil(own_robot, site, site.replace("-0.1", "-0.12"), "model.xml")
    robot = load_robot(own_robot)
    assert robot.standing.position[2] == pytest.approx(0.12)
    assert robot.standing_neck_height == pytest.approx(0.17)
    statics = Statics(robot)
    assert statics.make_posture(robot.standing.joint_pos).position[2] == pytest.approx(0.12)
    assert statics.measure_neck(robot.standing.joint_pos) == pytest.approx(1.0)


def test_a_joint_may_have_a_gain_of_its_own(own_robot, tiny):
    spoil(own_robot, 'id = 2, servo = "XM430-W350"', 'id = 2, servo = "XM430-W350", p_gain = 400')
    robot = load_robot(own_robot)
    assert robot.p_gain.tolist() == [800, 400]
    assert robot.position_gain == pytest.approx(tiny.position_gain * [1.0, 0.5])
    gains = robot.spec().compile().actuator_gainprm
    assert gains[:, KP] == pytest.approx(robot.position_gain)


@given(period=st.floats(0.0005, 0.05), longest=st.sampled_from([0.001, 0.002, 0.004]))
def test_the_physics_step_is_the_longest_that_divides_the_control_period(tiny, period, longest):
    step = replace(tiny, control_period=period).choose_timestep(longest)
    steps = round(period / step)
    assert steps * step == pytest.approx(period, abs=1e-9)
    assert step <= longest + 1e-9
    assert steps == 1 or period / (steps - 1) > longest


@pytest.mark.parametrize(
    ("period", "step"), [(0.008, 0.002), (0.0125, 0.0125 / 7), (0.02, 0.002), (0.001, 0.001)]
)
def test_a_robot_may_have_any_control_period(own_robot, period, step):
    spoil(own_robot, "control_period = 0.008", f"control_period = {period}")
    robot = load_robot(own_robot)
    assert robot.spec().compile().opt.timestep == step
    with Twin(robot) as twin:
        twin.read()
        twin.write(Command.position(robot, np.zeros(2)))
        assert twin.read().time == pytest.approx(period)


def test_an_unknown_robot_is_named_with_what_is_expected():
    words = r"unknown robot '.*': expected human, op3, toddlerbot, wolfgang, or a folder"
    names = ("nao", "", "../..", "/nowhere/at/all", "a\nb")
    for name, message in (*((name, words) for name in names), ("x" * 300, "File name too long")):
        with pytest.raises(RobotError, match=message) as caught:
            load_robot(name)
        assert "\n" not in str(caught.value), name
        assert len(str(caught.value)) < 200, name


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


Toml = dict[str, Any]
Change = Callable[[Toml], object]
NUMBERS = st.floats(-3.0, 3.0)


TEXT = (TINY / "robot.toml").read_text("utf-8")


def read(change: Change = lambda _: None) -> tuple[RobotTable, list[str]]:
    """Read the description of the tiny robot with a change."""
    toml = tomllib.loads(TEXT)
    change(toml)
    return read_description(toml, servo_models())


def couple(*matrix: list[float]) -> Change:
    row = {"joints": ["l_hip", "r_hip"], "matrix": list(matrix)}
    return lambda toml: toml.setdefault("couplings", []).append(row)


def test_a_joint_is_in_one_coupling_and_has_no_gear_there():
    def twice(toml: Toml) -> None:
        for _ in range(2):
            couple([1.0, 0.5], [0.5, 1.0])(toml)
        toml["joints"][0]["gear"] = 2.0

    _, problems = read(twice)
    assert problems == [
        "couplings: joint 'l_hip' is named 2 times, expected once",
        "couplings: joint 'r_hip' is named 2 times, expected once",
        "joint 'l_hip': gear is 2, expected none: it is in its coupling",
    ]


@given(row=st.tuples(NUMBERS, NUMBERS), share=NUMBERS)
def test_servos_that_turn_joints_in_one_ratio_are_no_coupling(row: tuple[float, float], share):
    _, problems = read(couple([*row], [share * each for each in row]))
    assert "expected independent rows" in problems[0]


def test_torque_is_limited_by_current_only_where_all_servos_sense_it(tiny: Robot):
    assert tiny.limit_by == "current"

    def mix(toml: Toml) -> None:
        toml["joints"][1]["servo"] = "XL430-W250"
        toml.update(limit_by="current", supply_voltage=12.0)

    _, problems = read(mix)
    assert problems == [
        'limit_by is "current", expected "pwm": the XL430-W250 of joint \'r_hip\' has no current '
        "sensor"
    ]
