"""What is trunk, limb and head; where limbs point, and the angles that point them back."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_robots import LEGS, limb, make_robot

from robots import Robot, RobotError, load_robot
from robots.body.limb_solver import LimbSolver, Trunk
from robots.body.limbs import Limb, LimbName, Limbs
from robots.body.parts import BodyParts, Link, find_arm_joints, find_robot_parts, leg_length

SIDES: tuple[tuple[LimbName, LimbName], ...] = (
    ("left_arm", "right_arm"),
    ("left_leg", "right_leg"),
)


def ends(robot: Robot, found: Limb) -> list[str | None]:
    """Name the joints at which the parts of a limb begin and end."""
    places = (found.start, found.middle, found.end)
    return [None if k is None else robot.joint_names[k] for k in places]


def arm_of(folder: Path, *joints: tuple[str, str, str], at: str = "0 0.3 0.15") -> list[str | None]:
    """Build a robot with a left arm of joints (name, place in the last one, axis).

    Its first joint is at a place. Return the joints at which its parts begin and end.
    """
    inside = ""
    for name, place, axis in reversed(joints):
        inside = limb(name, place, axis, inside)
    robot = make_robot(folder, LEGS + inside.replace(f'pos="{joints[0][1]}"', f'pos="{at}"', 1))
    found = Limbs(robot).all["left_arm"]
    assert [robot.joint_names[k] for k in found.joints] == [name for name, *_ in joints]
    return ends(robot, found)


PITCH, ROLL, ALONG = "0 1 0", "1 0 0", "0 0 1"
HERE, BELOW = "0 0 0", "0 0 -0.1"


SHIPPED = {
    "op3": (["l_sho_roll", "l_el", None], ["l_hip_pitch", "l_knee", "l_ank_pitch"]),
    "wolfgang": (["LShoulderRoll", "LElbow", None], ["LHipPitch", "LKnee", "LAnklePitch"]),
    "toddlerbot": (
        ["left_shoulder_roll", "left_elbow_roll", "left_wrist_pitch"],
        ["left_hip_roll", "left_knee", "left_ankle_pitch"],
    ),
    "human": (["l_sho_roll", "l_elbow", "l_wrist_roll"], ["l_hip_pitch", "l_knee", "l_ankle_yaw"]),
}
"""Where the left arm and the left leg of each begin, bend and end."""


@pytest.mark.parametrize("name", SHIPPED)
def test_limbs_of_both_sides_are_mirror_images(name: str):
    """They begin, bend and end where they should."""
    robot = load_robot(name)
    found, image = Limbs(robot).all, robot.mirror_index
    assert set(found) == {limb for side in SIDES for limb in side}
    assert (ends(robot, found["left_arm"]), ends(robot, found["left_leg"])) == SHIPPED[name]
    for one, other in SIDES:
        left, right = found[one], found[other]
        assert [image[k] for k in left.joints] == list(right.joints)
        assert (image[left.start], image[left.middle]) == (right.start, right.middle)
        assert (left.end is None) == (right.end is None)
        if left.end is not None:
            assert image[left.end] == right.end


def test_a_robot_may_lack_arms_and_legs_may_hang_on_a_waist(tmp_path: Path):
    """Joints of the head are not an arm; the sole of each leg is on its own chain."""
    head = limb("pan", "0 0 0.2", axis="0 0 1", inside=limb("tilt", "0 0 0"))
    waist = limb("waist", "0 0 0", axis="0 0 1", inside=LEGS)
    limbs = Limbs(make_robot(tmp_path, waist + head, head=("pan", "tilt")))
    assert set(limbs.all) == {"left_leg", "right_leg"}
    legs = limbs.all["left_leg"], limbs.all["right_leg"]
    assert [limbs.model.site(leg.sole).name for leg in legs] == ["l_sole", "r_sole"]
    assert limbs.robot.joint_names.index("waist") not in legs[0].joints


def test_the_upper_part_begins_where_the_last_joint_bends_it(tmp_path: Path):
    """Not where one twists it; its middle is farthest from both ends, and a wrist ends the rest."""
    arm = (("pitch", HERE, PITCH), ("twist", HERE, ALONG), ("elbow", BELOW, PITCH))
    assert arm_of(tmp_path, *arm) == ["pitch", "elbow", None]
    arm = (("pitch", HERE, PITCH), ("roll", HERE, ROLL), ("elbow", BELOW, PITCH))
    arm = (*arm, ("wrist", "0 0 -0.08", PITCH))
    assert arm_of(tmp_path, *arm) == ["roll", "elbow", "wrist"]


def test_a_robot_without_two_legs_with_knees_is_refused(tiny: Robot):
    with pytest.raises(ValueError, match="robot 'tiny' has no two legs with a knee"):
        Limbs(tiny)


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


@settings(max_examples=15)
@given(seed=st.integers(0, 1000))
def test_pointing_limbs_where_they_point_changes_nothing(seed: int, limbs: Limbs):
    """There and back again: angles near the stance give directions that give those directions."""
    robot, rng = limbs.robot, np.random.default_rng(seed)
    angles = robot.standing.joint_pos + rng.uniform(-0.3, 0.3, robot.n)
    angles = np.clip(angles, robot.lower, robot.upper)
    wanted = limbs.measure(angles)
    solved = LimbSolver(limbs).solve(wanted, robot.standing.joint_pos)
    assert np.all((robot.lower <= solved) & (solved <= robot.upper))
    found = limbs.measure(solved)
    for name, pose in wanted.items():
        for part in ("upper", "lower"):
            cosine = getattr(pose, part) @ getattr(found[name], part)
            assert np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) < 2.0, (name, part)


def test_the_mass_is_shifted_as_far_forward_as_asked_for(limbs: Limbs):
    stance = limbs.robot.standing.joint_pos
    before = limbs.measure_balance(stance)
    assert before is not None
    shifted = LimbSolver(limbs).solve_balance(before + 0.05, stance)
    after = limbs.measure_balance(shifted)
    assert after == pytest.approx(before + 0.05, abs=0.01)


NECK = '<site name="neck" pos="0 0 0.1"/>'


def with_neck_on(folder: Path, bodies: str) -> Robot:
    """Make a robot whose neck is on what hangs on its torso."""
    make_robot(folder, LEGS + bodies.replace('"neck"', '"top"'))
    toml = folder / "robot.toml"
    toml.write_text(toml.read_text("utf-8").replace('neck_site = "neck"', 'neck_site = "top"'))
    return load_robot(folder)


def test_the_chest_is_turned_where_it_is_asked_to(tmp_path: Path):
    """A torso with a waist that yaws and a chest that pitches, with the neck on it."""
    chest = limb("waist", "0 0 0.1", axis="0 0 1", inside=limb("chest", "0 0 0.02", inside=NECK))
    robot = with_neck_on(tmp_path, chest)
    trunk, wanted = Trunk(robot), robot.standing.joint_pos.copy()
    wanted[trunk.joints] = [0.4, -0.3]
    found = trunk.solve(trunk.measure(wanted), robot.standing.joint_pos)
    assert found[trunk.joints] == pytest.approx([0.4, -0.3], abs=0.01)
    others = [k for k in range(robot.n) if k not in trunk.joints]
    assert len(others) == 4
    assert found[others] == pytest.approx(wanted[others])


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
