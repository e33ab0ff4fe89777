"""Parts of a body: what is trunk, where legs, arms and heads begin."""

from pathlib import Path

import pytest
from tiny_robots import LEGS, limb, make_robot

from robots import Robot, RobotError
from robots.body.links import Link
from robots.body.parts import BodyParts, find_arm_joints, find_robot_parts, leg_length

L_ARM = limb("l_arm", "0 0.08 0.15", inside=limb("l_elbow", "0 0 -0.1"))
R_ARM = limb("r_arm", "0 -0.08 0.15", inside=limb("r_elbow", "0 0 -0.1"))
HEAD = limb("pan", "0 0 0.2", axis="0 0 1", inside=limb("tilt", "0 0 0"))


def find(robot: Robot) -> BodyParts:
    return find_robot_parts(robot, robot.spec().compile())


def names(links: list[Link]) -> list[str]:
    return [link.model.body(link.root).name for link in links]


def firsts(limbs: list[tuple[Link, Link]]) -> list[str]:
    return names([link for _, link in limbs])


def test_limbs_on_the_torso_are_distinguished_by_soles_and_the_head(tmp_path: Path):
    """A hand that branches and a tail in the middle, which ends in nothing, are no trunk."""
    parts = find(make_robot(tmp_path, LEGS + L_ARM + R_ARM + HEAD, head=("pan", "tilt")))
    assert names(parts.trunk) == ["torso"]
    assert firsts(parts.legs) == ["l_hip_link", "r_hip_link"]
    assert firsts(parts.arms) == ["l_arm_link", "r_arm_link"]
    assert firsts(parts.heads) == ["pan_link"]
    fingers = limb("thumb", "0 0.02 -0.1") + limb("finger", "0 -0.02 -0.1")
    for bodies in (
        limb("wrist", "0 0.1 0.15", inside=fingers),
        limb("tail", "-0.1 0 0", inside=limb("tip", "-0.1 0 0")),
    ):
        parts = find(make_robot(tmp_path, LEGS + bodies))
        assert names(parts.trunk) == ["torso"]
        assert firsts(parts.arms) in (["wrist_link"], ["tail_link"])


@pytest.mark.parametrize(
    ("carried", "trunk"),
    [
        (L_ARM + R_ARM, ["waist_link"]),
        (
            limb("bend", "0 0 0.02", inside=limb("roll", "0 0 0", inside=L_ARM + R_ARM)),
            ["waist_link", "bend_link", "roll_link"],
        ),
        (limb("arm", "0 0.1 0.1") + HEAD, ["waist_link"]),
    ],
    ids=["chest", "chest on a spine", "one arm and a head"],
)
def test_what_carries_limbs_is_trunk(tmp_path: Path, carried: str, trunk: list[str]):
    bodies = LEGS + limb("waist", "0 0 0.05", axis="0 0 1", inside=carried)
    parts = find(make_robot(tmp_path, bodies, head=("pan", "tilt")))
    assert names(parts.trunk) == ["torso", *trunk]
    assert firsts(parts.arms)[0] in ("l_arm_link", "arm_link")


def test_a_pelvis_on_a_waist_is_trunk_and_its_limbs_are_legs(tmp_path: Path):
    parts = find(make_robot(tmp_path, limb("waist", "0 0 0", axis="0 0 1", inside=LEGS)))
    assert names(parts.trunk) == ["torso", "waist_link"]
    assert [names([owner]) for owner, _ in parts.legs] == [["waist_link"]] * 2


def test_arm_joints_are_those_of_arms_that_a_rise_moves(op3: Robot):
    model = op3.spec().compile()
    found = {n for n, a in zip(op3.joint_names, find_arm_joints(op3, model), strict=True) if a}
    assert found == {f"{side}_{name}" for side in "lr" for name in ("sho_pitch", "sho_roll", "el")}


def test_a_leg_is_as_long_as_from_its_hip_to_its_sole(tmp_path: Path):
    assert leg_length(make_robot(tmp_path, LEGS)) == pytest.approx(0.2)
    legs = LEGS.replace('<site name="l_sole" pos="0 0 -0.1"/>', "")
    with pytest.raises(RobotError, match="no leg that ends in site 'l_sole'"):
        leg_length(make_robot(tmp_path, legs + '<site name="l_sole" pos="0 0 -0.2"/>'))
