"""Limbs of the robots that are shipped, and of some that no one builds, but that say more."""

from pathlib import Path

import pytest
from tiny_robots import LEGS, limb, make_robot

from robots import Robot, load_robot
from robots.body.joint_view import JointView
from robots.body.limb import Limb, LimbName
from robots.body.limb_finder import find_limbs

SIDES: tuple[tuple[LimbName, LimbName], ...] = (
    ("left_arm", "right_arm"),
    ("left_leg", "right_leg"),
)


def find(robot: Robot) -> dict[LimbName, Limb]:
    view = JointView.of(robot)
    view.look(robot.standing.joint_pos)
    return find_limbs(robot, view)


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
    found = find(robot)["left_arm"]
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
    robot = load_robot(name)
    found, image = find(robot), robot.mirror_index
    assert set(found) == {limb for side in SIDES for limb in side}
    for one, other in SIDES:
        left, right = found[one], found[other]
        assert [image[k] for k in left.joints] == list(right.joints)
        assert (image[left.start], image[left.middle]) == (right.start, right.middle)
        assert (left.end is None) == (right.end is None)
        if left.end is not None:
            assert image[left.end] == right.end


def test_a_limb_is_on_the_side_where_it_begins_and_ends(tmp_path: Path):
    """High shoulders, near the middle: how high they are says nothing."""
    arms = [
        limb(f"{side}_shoulder", f"0 {y} 0.15", inside=limb(f"{side}_elbow", BELOW))
        for side, y in (("l", 0.03), ("r", -0.03))
    ]
    robot = make_robot(tmp_path, LEGS + "".join(arms))
    found = find(robot)
    assert robot.joint_names[found["left_arm"].middle] == "l_elbow"
    assert robot.joint_names[found["right_arm"].middle] == "r_elbow"


def test_of_several_arms_on_a_side_the_outermost_counts(tmp_path: Path):
    arms = [
        limb(name, f"0 {y} 0.15", inside=limb(f"{name}_elbow", BELOW))
        for name, y in (("inner", 0.1), ("outer", 0.3), ("middle", 0.2))
    ]
    robot = make_robot(tmp_path, LEGS + "".join(arms))
    found = find(robot)
    assert set(found) == {"left_arm", "left_leg", "right_leg"}
    assert robot.joint_names[found["left_arm"].start] == "outer"


def test_the_upper_part_begins_where_the_last_joint_bends_it(tmp_path: Path):
    """Not at the joint that twists it, above the elbow."""
    arm = (("pitch", HERE, PITCH), ("twist", HERE, ALONG), ("elbow", BELOW, PITCH))
    assert arm_of(tmp_path, *arm) == ["pitch", "elbow", None]


def test_the_middle_is_farthest_from_both_ends_and_a_wrist_ends_the_lower_part(tmp_path: Path):
    arm = (
        ("pitch", HERE, PITCH),
        ("roll", HERE, ROLL),
        ("elbow", BELOW, PITCH),
        ("wrist", "0 0 -0.08", PITCH),
    )
    assert arm_of(tmp_path, *arm) == ["roll", "elbow", "wrist"]


def test_a_robot_without_two_legs_with_knees_is_refused(tiny: Robot):
    with pytest.raises(ValueError, match="robot 'tiny' has no two legs with a knee"):
        find(tiny)
