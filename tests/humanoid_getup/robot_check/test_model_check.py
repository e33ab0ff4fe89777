"""The check of a model: masses and mirror pairs, on robots small enough to print."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_robots import LEGS, limb, make_robot

from humanoid_getup.robot_check.model_check import check_body, check_mirrors, check_turns
from robots.body.limbs import Limbs

ARMS = "".join(
    limb(f"{s}_arm", f"0 {y} 0.15", inside=limb(f"{s}_elbow", "0 0 -0.1"))
    for s, y in (("l", 0.1), ("r", -0.1))
)


@pytest.fixture
def limbs(tmp_path: Path) -> Limbs:
    return Limbs(make_robot(tmp_path, LEGS + ARMS))


def test_a_robot_lighter_than_its_servos_is_named(tmp_path: Path):
    light = (LEGS + ARMS).replace('mass="0.1"', 'mass="0.01"')
    (found, *_) = check_body(Limbs(make_robot(tmp_path, light)))
    # By hand: 8 servos of 82 g; 0.5 kg and 8 links of 10 g.
    assert found.level == "warning"
    assert found.text == "weighs 0.58 kg, less than its 8 servos, 0.66 kg"


@pytest.mark.parametrize(("name", "level"), [("l_arm", "ok"), ("l_knee", "warning")])
def test_a_full_turn_is_named_and_of_a_leg_warned(limbs: Limbs, name: str, level: str):
    assert not [*check_turns(limbs)]
    turned = [
        replace(joint, lower=-np.pi, upper=np.pi) if joint.name == name else joint
        for joint in limbs.robot.joints
    ]
    limbs.robot = replace(limbs.robot, joints=tuple(turned))
    (found,) = check_turns(limbs)
    assert (found.level, found.text) == (level, f"a full turn is that of {name}")


def test_a_neck_below_the_shoulders_is_named(tmp_path: Path):
    high = ARMS.replace("0.15", "0.25")
    texts = [str(found) for found in check_body(Limbs(make_robot(tmp_path, LEGS + high)))]
    assert "site 'neck': is 50 mm below the shoulders, expected above them" in texts[-1]


def test_a_wrong_sign_is_named_with_the_right_one(limbs: Limbs):
    limbs.robot = replace(limbs.robot, mirror_sign=-limbs.robot.mirror_sign)
    found = [*check_mirrors(limbs)]
    assert [each.level for each in found] == ["fault"] * 4
    assert found[0].text == "mirror_sign is -1, but its axis says +1 for its mirror 'r_hip'"


def test_a_joint_without_image_is_named(tmp_path: Path):
    lever = limb("lever", "0 0.15 0.1")
    found = [*check_mirrors(Limbs(make_robot(tmp_path, LEGS + ARMS + lever)))]
    assert [str(each).split(";")[0] for each in found] == [
        "joint 'lever': its mirror is itself, which is not its mirror image in the model"
    ]
