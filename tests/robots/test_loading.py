"""Loading robots: by name, from a folder, and what is said of a wrong description."""

from pathlib import Path

import numpy as np
import pytest

from robots import load_robot
from robots.robot import RobotError, list_robots


def spoil(folder: Path, old: str, new: str, file: str = "robot.toml") -> None:
    path = folder / file
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def complaint(folder: Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(folder)
    message = str(caught.value)
    assert "\n" not in message, "one line is enough"
    assert str(folder) in message
    return message


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


@pytest.mark.parametrize("name", ["nao", "", "../..", "/nowhere/at/all"])
def test_an_unknown_robot_is_named_with_what_is_allowed(name):
    with pytest.raises(RobotError, match=r"unknown robot '.*': allowed op3, or a folder") as caught:
        load_robot(name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('torso = "torso"\n', "", "torso is missing"),
        ("id = 2, ", "", "id is missing"),
        ('"XM430-W350", sign = -1', '"XM999", sign = -1', "joint 'r_hip': unknown servo 'XM999'"),
        ("sign = -1, zero", "sign = 2, zero", "servo 2: sign is 2, allowed -1 or 1"),
        ('name = "r_hip"', 'name = "q_hip"', "'q_hip'"),
        ('mirror = "r_hip"', 'mirror = "q_hip"', "'q_hip'"),
        ('torso = "torso"', 'torso = "trunk"', "'trunk'"),
        ('"r_sole"]', '"x_sole"]', "'x_sole'"),
        ('neck_site = "neck"', 'neck_site = "nick"', "'nick'"),
        ("[standing]\nl_hip", "[standing]\nq_hip", "'q_hip'"),
        ("joints = [", "joints = {", "line 11"),
    ],
)
def test_a_wrong_description_is_told_in_one_line(own_robot, old, new, words):
    spoil(own_robot, old, new)
    assert words in complaint(own_robot)


def test_a_missing_or_broken_model_is_told_in_one_line(own_robot):
    spoil(own_robot, "</mujoco>", "", file="model.xml")
    assert "XML" in complaint(own_robot)
    (own_robot / "model.xml").unlink()
    assert "model.xml" in complaint(own_robot)
