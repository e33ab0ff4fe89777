"""What is said of a robot folder that is wrong."""

from typing import get_args

import pytest
from spoiling import complaint, spoil

from humanoid_getup.motions.posture_metric import SEGMENT_WEIGHT
from robots.description.schema import Segment

L_HIP = 'name = "l_hip", id = 1, servo = "XM430-W350", sign = 1'
LEG = '<joint name="l_hip" axis="0 1 0" range="-90 60"/>'
BALL = '<body name="ball"><freejoint/><geom size="1"/></body>'
MOTOR = '<actuator><motor name="m" joint="l_hip"/></actuator>'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("period = 0.008", "period = -0.008", "control_period is -0.008 s, expected 0.001 to 1 s"),
        ("voltage = 12.0", "voltage = -12", "supply_voltage is -12 V, expected above 0 V"),
        ("voltage = 12.0", "voltage = 9", "9 V, expected 10 to 14.8 V by the XM430-W350 of joint"),
        ('torso = "torso"\n', "", "torso is missing"),
        ('torso = "torso"', 'torso = "trunk"', "torso: unknown body 'trunk', expected torso"),
        ('torso = "torso"', 'torso = "l_leg"', "body 'l_leg' has no free joint in model.xml"),
        ('"neck"', '"nick"', "neck_site: unknown site 'nick', expected imu, neck, l_sole, r_sole"),
        ('imu_site = "imu"\n', "", "imu_site is missing, expected the site"),
        ("[standing]", "[sitting]", "standing is missing, expected a table of joint names"),
        ("]\nl_hip", "]\nq_hip", "standing: unknown joint 'q_hip', expected 'l_hip'"),
        ("l_hip = 0.0", "l_hip = 1.2", "'l_hip' is +1.200 rad, expected [-1.571, +1.047] rad"),
        ("id = 2, ", "", "joint 'r_hip': id is missing, expected an integer from 0 to 252"),
        ("id = 2, ", "id = 1, ", "joints 'l_hip', 'r_hip' have one servo id, 1, expected one id"),
        ('servo = "XM430-W350"', 'servo = "XM9"', "joint 'r_hip': servo is 'XM9', expected XM4"),
        ('mirror = "r_hip"', 'mirror = "q_hip"', "joint 'l_hip': unknown mirror joint 'q_hip'"),
        ('mirror = "r_hip"', 'mirror = "l_hip"', "'l_hip' has the mirror 'l_hip', expected 'r_"),
        ('r = "r_hip", mirror_sign = 1', 'r = "r_hip", mirror_sign = -1', "'l_hip': mirror_sign "),
        ('name = "r_hip"', 'name = "l_hip"', "joint 'l_hip' is described 2 times, expected once"),
        ('name = "r_hip"', 'name = "q_hip"', "'q_hip' is not in model.xml, expected l_hip, r_hip"),
        ('name = "r_hip"', 'name = "root"', "joint 'root' is a free joint, expected a hinge"),
        ("baud = 1_000_000", "baud = 1_000_001", "bus.baud is 1000001, expected 9600, 57"),
        ("baud = 1_000_000", "watchdog = 9", "bus.watchdog is 9 s, expected above 0 s, at most 2"),
        ("id = 200", "id = 2", "bus.board.id is 2, that of joint 'r_hip', expected an id of its"),
        ("[bus.board]", '[bus.ports]\nlegs = ["l_hip"]\n[bus.board]', "'r_hip' is on 0 ports"),
        ("[bus.board]", '[bus.ports]\nlegs = ["hip"]\n[bus.board]', "unknown joint 'hip'"),
    ],
)
def test_a_wrong_value_is_reported_with_its_place_and_what_is_expected(own_robot, old, new, words):
    spoil(own_robot, old, new)
    assert words in complaint(own_robot)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("</mujoco>", "", "XML"),
        ('<geom type="box" size="0.02 0.05 0.05" mass="0.5"/>', "<gem/>", "unrecognized element"),
        ('<freejoint name="root"/>', "", "torso: body 'torso' has no free joint in model.xml"),
        (LEG, LEG.replace(' range="-90 60"', ""), "joint 'l_hip' has no range in model.xml"),
        (LEG, LEG.replace("-90 60", "10 60"), "standing: joint 'l_hip' is +0.000 rad, expected [+"),
        (LEG, LEG + '<joint name="l_toe"/>', "hinge joint 'l_toe' of body 'l_leg' in model.xml"),
        (
            "</worldbody>",
            f"{BALL}</worldbody>",
            "body 'ball' in model.xml has a free joint, expected",
        ),
        ("</mujoco>", f"{MOTOR}</mujoco>", "model.xml has actuators (m), expected none"),
        ('"neck" pos="0 0 0.05"', '"neck" pos="0 0 -0.2"', "neck_site 'neck' is -0.100 m over the"),
    ],
)
def test_a_wrong_model_is_reported_with_what_is_expected(own_robot, old, new, words):
    spoil(own_robot, old, new, file="model.xml")
    assert words in complaint(own_robot)


def test_a_joint_that_cannot_be_at_zero_must_be_named_in_the_stance(own_robot):
    spoil(own_robot, LEG, LEG.replace("-90 60", "10 60"), file="model.xml")
    spoil(own_robot, "[standing]\nl_hip = 0.0", "[standing]")
    words = "standing: joint 'l_hip' (not named, so 0) is +0.000 rad, expected [+0.175, +1.047] rad"
    assert words in complaint(own_robot)


def test_all_that_is_wrong_is_reported_at_once(own_robot):
    assert L_HIP in (own_robot / "robot.toml").read_text("utf-8")
    for old, new in (
        ("period = 0.008", "period = -1"),
        ('"imu"', '"eye"'),
        (L_HIP, L_HIP.replace("id = 1", 'id = "x"')),
        ("r_hip = 0.0", "r_hip = 9"),
    ):
        spoil(own_robot, old, new)
    spoil(own_robot, LEG, LEG.replace(' range="-90 60"', ""), file="model.xml")
    faults = complaint(own_robot).split("; ")
    assert [fault.partition(", expected")[0] for fault in faults] == [
        "control_period is -1 s",
        "joint 'l_hip': id is 'x'",
        "imu_site: unknown site 'eye'",
        "joint 'l_hip' has no range in model.xml",
        "standing: joint 'r_hip' is +9.000 rad",
    ]


def test_every_segment_has_a_weight_in_the_metric():
    assert set(get_args(Segment)) == set(SEGMENT_WEIGHT)


PERIOD = "control_period = 0.008"


def test_without_a_word_one_joint_of_each_pair_of_limbs_rises(tiny, op3):
    assert tiny.rising_joints == ("l_hip",)
    mirror = op3.mirror_index
    rows = [op3.joint_names.index(name) for name in op3.rising_joints]
    assert len(rows) == 6
    assert {int(mirror[row]) for row in rows}.isdisjoint(rows)
    assert op3.spreading_joints == ("l_hip_roll",)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('spreading_joints = ["l_toe"]', "spreading_joints: unknown joint 'l_toe'"),
        ('spreading_joints = ["r_hip"]', "'r_hip' is one of rising_joints, expected others"),
        ("spreading_joints = []", "spreading_joints is [], expected a list of texts, at least one"),
        ('rising_joints = ["l_toe"]', "rising_joints: unknown joint 'l_toe'"),
        ('rising_joints = ["l_hip", "r_hip"]', "rising_joints: 'l_hip', expected one joint of a m"),
        ("rising_joints = []", "rising_joints is [], expected a list of texts, at least one"),
    ],
)
def test_wrong_rising_and_spreading_joints_are_reported(own_robot, line, words):
    spoil(own_robot, PERIOD, f"{PERIOD}\n{line}")
    assert words in complaint(own_robot)
