"""Mirror pairs of joints by place and axis; the left one by its name, else by where it is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty

from robots import Robot, load_robot
from robots.body.sides import JointSides, MirrorPairs, find_mirror, remove_side, side_of, swap_side

PAIRS = [
    ("l_knee", "r_knee", "knee"),
    ("left_hip_pitch", "right_hip_pitch", "hip_pitch"),
    ("hip_pitch_left", "hip_pitch_right", "hip_pitch"),
    ("hip_pitch_l", "hip_pitch_r", "hip_pitch"),
    ("LHipPitch", "RHipPitch", "HipPitch"),
    ("hipPitchL", "hipPitchR", "hipPitch"),
    ("LeftAnkle-roll", "RightAnkle-roll", "Ankle-roll"),
    ("left.wrist2", "right.wrist2", "wrist2"),
    ("leftKnee", "rightKnee", "Knee"),
    ("J_L_KNEE", "J_R_KNEE", "J_KNEE"),
    ("leg_left_2", "leg_right_2", "leg_2"),
]


def test_a_pair_is_recognized_by_its_names_and_its_left_joint_by_its_name(tiny: Robot):
    for left, right, bare in nonempty(PAIRS):
        assert (swap_side(left), swap_side(right)) == (right, left)
        assert (side_of(left), side_of(right)) == (1, -1), left
        assert remove_side(left, right) == remove_side(right, left) == bare
        # The description's second joint is on the right: here its name alone says otherwise.
        for names in ((left, right), (right, left)):
            sides = JointSides(rename(tiny, *names))
            (joint,) = sides.left
            assert names[joint] == left
            assert sides.by_name == {bare: joint, left: joint}
            assert sides.name(joint) == bare


def rename(robot: Robot, *names: str) -> Robot:
    joints = [replace(j, name=name) for j, name in zip(robot.joints, names, strict=True)]
    return replace(robot, joints=tuple(joints))


def with_names(folder: Path, left: str, right: str) -> Robot:
    for file in (folder / "robot.toml", folder / "model.xml"):
        file.write_text(file.read_text().replace("l_hip", left).replace("r_hip", right))
    return load_robot(folder)


@pytest.mark.parametrize(("left", "right"), [("motor_1", "motor_2"), ("motor_2", "motor_1")])
def test_where_names_do_not_say_the_left_joint_is_on_the_left(left, right, own_robot: Path):
    robot = with_names(own_robot, left, right)
    sides = JointSides(robot)
    assert [robot.joint_names[joint] for joint in sides.left] == [left]
    assert list(sides.by_name) == [left]


def test_joints_on_the_middle_plane_are_distinguished_by_their_limbs(own_robot: Path):
    robot = with_names(own_robot, "motor_2", "motor_1")
    model = own_robot / "model.xml"
    text = model.read_text().replace('axis="0 1 0"', 'axis="0 1 0" pos="0 -0.07 0"', 1)
    text = text.replace('axis="0 1 0" range', 'axis="0 1 0" pos="0 0.07 0" range')
    model.write_text(text)
    assert [robot.joint_names[joint] for joint in JointSides(robot).left] == ["motor_2"]


X, Y, Z = np.eye(3)


def pair(names: list[str], anchors: list, axes: list) -> MirrorPairs:
    points = np.array(anchors, dtype=float)
    return find_mirror(names, points, np.array(axes), points, [1] * len(names), 1.0)


def test_what_has_no_image_or_is_in_the_middle_is_its_own_mirror():
    found = pair(["pan", "tilt", "l_lever"], [[0, 0, 0.5], [0, 0, 0.9], [0.1, 0.4, 0]], [Z, Y, Y])
    assert found.index.tolist() == [0, 1, 2]
    assert found.sign[:2].tolist() == [-1.0, 1.0]
    assert found.unpaired == (2,)


def test_hinges_at_one_place_are_paired_by_name_else_by_how_many_are_above_them():
    places = np.array([[0, 0.1, 0], [0, 0.1, 0], [0, -0.1, 0], [0, -0.1, 0]])
    assert pair(["l_a", "l_b", "r_b", "r_a"], [*places], [Y] * 4).index.tolist() == [3, 2, 1, 0]
    for depths, pairs in (([1, 2, 2, 1], [3, 2, 1, 0]), ([1, 2, 1, 2], [2, 3, 0, 1])):
        found = find_mirror(["a", "b", "c", "d"], places, np.array([Y] * 4), places, depths, 1.0)
        assert found.index.tolist() == pairs


@given(seed=st.integers(0, 1000))
def test_a_mirrored_body_is_paired_with_itself(seed: int):
    rng = np.random.default_rng(seed)
    left = rng.uniform([-0.5, 0.2, 0.0], [0.5, 0.9, 3.0], (3, 3))
    left[:, 2] += np.arange(3)
    axes = np.array([X, Y, Z])[rng.integers(0, 3, 3)]
    names = [f"joint_{k}" for k in range(6)]
    found = pair(names, [*left, *left * [1, -1, 1]], [*axes, *axes])
    assert found.index.tolist() == [3, 4, 5, 0, 1, 2]
