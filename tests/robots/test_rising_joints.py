"""Which joints a learned rise moves, and spreads: read, filled in, refused where wrong."""

import pytest
from spoiling import complaint, spoil

PERIOD = "control_period = 0.008"


def say(folder, value: str) -> None:
    spoil(folder, PERIOD, f"{PERIOD}\nrising_joints = {value}")


def test_without_a_word_one_joint_of_each_pair_of_limbs_rises(tiny):
    assert tiny.rising_joints == ("l_hip",)


def test_op3_rises_by_six_pairs_and_spreads_its_legs(op3):
    mirror = op3.mirror_index
    rows = [op3.joint_names.index(name) for name in op3.rising_joints]
    assert len(rows) == 6
    assert {int(mirror[row]) for row in rows}.isdisjoint(rows)
    assert op3.spreading_joints == ("l_hip_roll",)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ('["l_toe"]', "spreading_joints: unknown joint 'l_toe'"),
        ('["r_hip"]', "spreading_joints: 'r_hip' is one of rising_joints, expected others"),
        ("[]", "spreading_joints is [], expected a list of texts, at least one"),
    ],
)
def test_wrong_spreading_joints_are_reported_with_what_is_expected(own_robot, value, words):
    spoil(own_robot, PERIOD, f"{PERIOD}\nspreading_joints = {value}")
    assert words in complaint(own_robot)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ('["l_toe"]', "rising_joints: unknown joint 'l_toe'"),
        ('["l_hip", "r_hip"]', "rising_joints: 'l_hip', expected one joint of a mirrored pair"),
        ('["l_hip", "l_hip"]', "rising_joints is ['l_hip', 'l_hip'], expected each name once"),
        ("[]", "rising_joints is [], expected a list of texts, at least one"),
        ('"l_hip"', "rising_joints is 'l_hip', expected a list of texts, at least one"),
        ("[1]", "rising_joints is [1], expected a list of texts, at least one"),
    ],
)
def test_wrong_rising_joints_are_reported_with_what_is_expected(own_robot, value, words):
    say(own_robot, value)
    assert words in complaint(own_robot)
