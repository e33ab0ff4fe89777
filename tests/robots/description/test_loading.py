"""Loading robots: by name and from a folder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiling import spoil

from drivers import Command, Twin
from robots import RobotError, load_robot
from robots.body.statics import Statics
from robots.drive import KP


def test_a_copy_of_a_robots_folder_is_the_same_robot(tiny, own_robot):
    own = load_robot(own_robot)
    assert own.folder == own_robot
    assert own.joints == tiny.joints
    assert np.array_equal(own.standing.position, tiny.standing.position)
    assert own.spec().compile().nu == tiny.n


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
