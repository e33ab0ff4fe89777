"""Abilities: squats, servos and arms, by figures worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.robot_check import check as ability_check
from humanoid_getup.robot_check.check import check_arms, check_depth, check_strength
from robots import Robot
from robots.body.limbs import Limbs
from robots.body.squats import Squat


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


def crouch(op3: Robot, share: float, torque: float = 0.0, **angles: float) -> Squat:
    """Make a squat in which all servos hold one torque [N·m]."""
    joint_pos = op3.standing.joint_pos.copy()
    for name, angle in angles.items():
        joint_pos[op3.joint_names.index(name)] = angle
    return Squat(joint_pos=joint_pos, neck_share=share, torque=np.full(op3.n, torque))


@pytest.mark.parametrize(("share", "level"), [(0.752, "ok"), (0.758, "warning")])
def test_the_deepest_squat_decides(limbs: Limbs, op3: Robot, share: float, level: str):
    found = check_depth(limbs, [crouch(op3, 0.9), crouch(op3, share)])
    assert found.level == level
    assert found.text.startswith(f"crouches in balance down to {share:.0%} of its neck height")


@pytest.mark.parametrize(
    ("touching", "text", "remedy"),
    [
        ([("hip", "calf")], "; deeper, shapes touch: 'hip' and 'calf'", "<exclude body1"),
        ([], "expected at most 75%", "its balance may"),
    ],
)
def test_shapes_that_stop_a_squat_are_named(limbs, op3, monkeypatch, touching, text, remedy):
    monkeypatch.setattr(ability_check, "find_touching", lambda *_: touching)
    found = check_depth(limbs, [crouch(op3, 0.8)])
    assert found.text.endswith(text)
    assert remedy in found.remedy


@pytest.mark.parametrize(
    ("stance", "squat", "share", "level"),
    [
        (1.0, 2.0, 0.5, "ok"),  # N·m of 4.1: below a half
        (1.0, 5.0, 0.5, "warning"),  # deeper than a rise needs
        (1.0, 5.0, 0.8, "fault"),
        (5.0, 0.0, 0.8, "fault"),
        (3.0, 0.0, 0.8, "warning"),
    ],
)
def test_servos_need_twice_what_they_hold(op3: Robot, stance, squat, share, level):
    found = [*check_strength(op3, np.full(op3.n, stance), [crouch(op3, share, squat)])]
    assert {each.level for each in found} == {level}
    assert len(found) == (1 if level == "ok" else op3.n)


def test_a_limp_joint_is_named_and_the_other_arm_carries_its_share(op3: Robot):
    limp = replace(op3, limp_joints=("l_sho_pitch",))
    found, squat = check_strength(limp, np.full(op3.n, 1.0), [])
    assert (found.level, found.subject) == ("warning", "joint 'l_sho_pitch'")
    assert "does not make the 1.00 N·m" in found.text
    assert squat.level == "ok"
    one, both = ([*check_arms(Limbs(robot), 10.0, 0.7)][-1] for robot in (limp, op3))
    needs = [float(each.text.split(" need ")[1].split()[0]) for each in (one, both)]
    assert needs[0] == pytest.approx(2.0 * needs[1], abs=0.02)
    armless = replace(op3, limp_joints=("l_sho_pitch", "r_el"))
    (alone,) = check_arms(Limbs(armless), 10.0, 0.7)
    assert alone.text.startswith("all that bend have a limp joint")


def test_arms_that_are_strong_enough_are_described(limbs: Limbs):
    reach, push = check_arms(limbs, 10.0, 0.7)
    assert (reach.level, push.level) == ("ok", "ok")
    upper, lower = limbs.measure_parts(limbs.all["left_arm"])
    # Half of the weight on two hands, at the end of straight arms.
    assert f"need {2.5 * (upper + lower):.2f} N·m" in push.text
