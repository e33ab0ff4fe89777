"""Loading robots: by name and from a folder."""

from pathlib import Path

import numpy as np
import pytest
from spoiling import spoil

from robots import RobotError, list_robots, load_robot
from robots.drive import KP


def test_op3_comes_with_the_package():
    assert "op3" in list_robots()
    assert load_robot("op3").name == "op3"


def test_a_copy_of_a_robots_folder_is_the_same_robot(tiny, own_robot):
    own = load_robot(own_robot)
    assert own.folder == own_robot
    assert own.joints == tiny.joints
    assert np.array_equal(own.standing.position, tiny.standing.position)
    assert own.spec().compile().nu == tiny.n


def test_a_folder_may_be_given_as_text(own_robot):
    assert load_robot(str(own_robot)).name == "tiny"


def test_a_name_means_the_packages_robot_whatever_folder_is_here(own_robot, monkeypatch):
    own_robot.rename(own_robot.parent / "op3")
    monkeypatch.chdir(own_robot.parent)
    assert load_robot("op3").name == "op3"
    assert load_robot("./op3").name == load_robot(Path("op3")).name == "tiny"


def test_a_robots_stance_is_worked_out_from_its_soles(tiny):
    # Legs of 0.1 m, neck 0.05 m over the hips.
    assert tiny.standing.position == pytest.approx([0.0, 0.0, 0.1])
    assert tiny.standing.orientation == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert tiny.standing_neck_height == pytest.approx(0.15)


def test_soles_level_a_leaning_stance(own_robot):
    spoil(own_robot, "l_hip = 0.0\nr_hip = 0.0", "l_hip = 0.3\nr_hip = 0.3")
    robot = load_robot(own_robot)
    # The legs stand upright when the torso leans the other way by their angle.
    assert robot.standing.orientation == pytest.approx([np.cos(0.15), 0.0, -np.sin(0.15), 0.0])
    assert robot.standing.position[2] == pytest.approx(0.1)


def test_a_joint_may_have_a_gain_of_its_own(own_robot, tiny):
    spoil(own_robot, 'id = 2, servo = "XM430-W350"', 'id = 2, servo = "XM430-W350", p_gain = 400')
    robot = load_robot(own_robot)
    assert robot.p_gain.tolist() == [800, 400]
    assert robot.position_gain == pytest.approx(tiny.position_gain * [1.0, 0.5])
    gains = robot.spec().compile().actuator_gainprm
    assert gains[:, KP] == pytest.approx(robot.position_gain)


@pytest.mark.parametrize("name", ["nao", "", "../..", "/nowhere/at/all", "a\nb"])
def test_an_unknown_robot_is_named_with_what_is_expected(name):
    with pytest.raises(
        RobotError, match=r"unknown robot '.*': expected human, op3, or a folder"
    ) as caught:
        load_robot(name)
    assert "\n" not in str(caught.value)


def test_a_name_too_long_for_a_folder_is_told_in_one_line():
    with pytest.raises(RobotError, match="File name too long") as caught:
        load_robot("x" * 300)
    assert len(str(caught.value)) < 200
