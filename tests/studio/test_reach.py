"""Laws of dragging: hands, feet and torso go where they can, and the rest keeps its place."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from spoiling import spoil

pytest.importorskip("mink")

from humanoid_getup.studio.inverse_kinematics import EndPose
from humanoid_getup.studio.pose_robot import mirror_turned, turn_joint
from humanoid_getup.studio.reach import LEAP, Drag, Reach
from robots import Posture, Robot, load_robot
from robots.body.limbs import LIMB_NAMES

ROBOTS = ("op3", "toddlerbot")
MILLIMETER = 0.001
SHIFTS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)

limbs, seeds = st.sampled_from(LIMB_NAMES), st.integers(0, 2**31)


@pytest.fixture(scope="module", params=ROBOTS)
def reach(request: pytest.FixtureRequest) -> Reach:
    return Reach(load_robot(request.param))


def bend(reach: Reach, limb: str, seed: int, most: float = 0.5) -> Posture:
    """Turn the joints of a limb of the stance at random."""
    rng, robot, start = np.random.default_rng(seed), reach.robot, reach.robot.standing
    joints = list(reach.list_joints(limb))
    angles = start.joint_pos.copy()
    angles[joints] += rng.uniform(-most, most, len(joints))
    return replace(start, joint_pos=np.clip(angles, robot.lower, robot.upper))


def move(pose: EndPose, shift: np.ndarray) -> EndPose:
    return replace(pose, position=pose.position + shift)


def measure_miss(reach: Reach, posture: Posture, handle: str, target: EndPose) -> float:
    return float(np.linalg.norm(reach.locate(posture, handle).position - target.position))


def is_within_limits(robot: Robot, posture: Posture) -> bool:
    return bool(np.all((posture.joint_pos >= robot.lower) & (posture.joint_pos <= robot.upper)))


@settings(max_examples=40)
@given(limb=limbs, seed=seeds)
def test_a_limb_reaches_where_its_joints_can_bring_it(reach: Reach, limb: str, seed: int):
    target = reach.locate(bend(reach, limb, seed), limb)
    found = reach.move_limb(reach.robot.standing, limb, target)
    assert measure_miss(reach, found, limb, target) < MILLIMETER
    assert is_within_limits(reach.robot, found)
    others = np.setdiff1d(np.arange(reach.robot.n), reach.list_joints(limb))
    assert np.array_equal(found.joint_pos[others], reach.robot.standing.joint_pos[others])
    assert np.array_equal(found.position, reach.robot.standing.position)


@settings(max_examples=40)
@given(limb=limbs, shift=SHIFTS)
def test_a_target_out_of_reach_breaks_no_limit_and_no_leap_is_long(
    reach: Reach, limb: str, shift: np.ndarray
):
    robot, start = reach.robot, reach.robot.standing
    drag = Drag(reach, start, limb, mirrored=False, feet_stay=True)
    target, before = move(reach.locate(start, limb), 5.0 * shift), start
    for _ in range(3):
        found = drag.to(target)
        assert is_within_limits(robot, found)
        assert np.abs(found.joint_pos - before.joint_pos).max() <= LEAP + 1e-9
        before = found


def test_a_leg_stretches_towards_a_target_out_of_reach(reach: Reach):
    robot = reach.robot
    leg = reach.locate(robot.standing, "left_leg")
    down = move(leg, np.array([0.0, 0.0, -5.0]))
    drag = Drag(reach, robot.standing, "left_leg", mirrored=False, feet_stay=True)
    lowest = reach.locate(drag.finish(down), "left_leg").position[2]
    # The oracle: the lowest sole of two thousand postures.
    rng, joints = np.random.default_rng(0), list(reach.list_joints("left_leg"))
    angles = np.tile(robot.standing.joint_pos, (2000, 1))
    near = robot.standing.joint_pos[joints] + rng.normal(0.0, 0.4, (2000, len(joints)))
    angles[:, joints] = np.clip(near, robot.lower[joints], robot.upper[joints])
    postures = (replace(robot.standing, joint_pos=row) for row in angles)
    assert lowest <= min(reach.locate(each, "left_leg").position[2] for each in postures)


@settings(max_examples=25)
@given(shift=SHIFTS, lowered=st.floats(0.0, 1.0))
def test_soles_stay_under_a_dragged_torso_whether_it_arrives_or_not(
    reach: Reach, shift: np.ndarray, lowered: float
):
    robot, height = reach.robot, reach.robot.standing_neck_height
    way = height * (0.2 * shift - np.array([0.0, 0.0, lowered]))
    drag = Drag(reach, robot.standing, "torso", mirrored=False, feet_stay=True)
    before = reach.locate_soles(robot.standing)
    for share in (0.25, 0.5, 1.0):
        found = drag.to(move(reach.locate(robot.standing, "torso"), share * way))
        for name, sole in reach.locate_soles(found).items():
            assert np.linalg.norm(sole.position - before[name].position) < MILLIMETER
        assert is_within_limits(robot, found)


@settings(max_examples=15)
@given(limb=limbs, seed=seeds)
def test_a_mirrored_drag_leaves_a_symmetric_robot(reach: Reach, limb: str, seed: int):
    robot = reach.robot
    drag = Drag(reach, robot.standing, limb, mirrored=True, feet_stay=True)
    found = drag.to(reach.locate(bend(reach, limb, seed, 0.3), limb)).joint_pos
    np.testing.assert_allclose(robot.mirror_joints(found), found, atol=1e-9)


@given(joint=st.integers(0, 19), angle=st.floats(-4.0, 4.0))
def test_a_mirrored_joint_turns_its_partner_and_one_in_the_middle_itself_alone(
    op3: Robot, joint: int, angle: float
):
    turned = turn_joint(op3, op3.standing, joint, angle, mirrored=True).joint_pos
    expected = op3.standing.joint_pos.copy()
    expected[joint] = np.clip(angle, op3.lower[joint], op3.upper[joint])
    partner = op3.mirror_index[joint]
    if partner != joint:
        expected[partner] = op3.mirror_sign[joint] * expected[joint]
    np.testing.assert_allclose(turned, expected, atol=1e-9)
    # Mirrored back from the other side, nothing changes.
    posture = replace(op3.standing, joint_pos=turned)
    again = mirror_turned(op3, posture, (int(partner),))
    np.testing.assert_allclose(again.joint_pos, turned, atol=1e-9)


def couple_ankles(folder: Path, op3: Robot) -> Robot:
    """Let gears drive the ankles from the knees, without servos of their own."""
    for file in ("robot.toml", "model.xml"):
        (folder / file).write_text((op3.folder / file).read_text("utf-8"), "utf-8")
    lines = (folder / "robot.toml").read_text("utf-8").splitlines()
    kept = [line for line in lines if "ank_pitch" not in line or "rising_joints" in line]
    (folder / "robot.toml").write_text("\n".join(kept) + "\n", "utf-8")
    spoil(folder, ', "l_ank_pitch"]', "]")
    spoil(folder, 'name = "op3"', 'name = "op3"\npassive_joints = ["l_ank_pitch", "r_ank_pitch"]')
    gears = "".join(
        f'<joint joint1="{side}_ank_pitch" joint2="{side}_knee" polycoef="0 0.2 {way}0.39 0 0"/>'
        for side, way in (("l", ""), ("r", "-"))
    )
    equality = f"</worldbody><equality>{gears}</equality>"
    spoil(folder, "</worldbody>", equality, "model.xml")
    return load_robot(folder)


def test_passive_joints_follow_a_dragged_leg(tmp_path: Path, op3: Robot):
    reach = Reach(robot := couple_ankles(tmp_path, op3))
    target = move(reach.locate(robot.standing, "left_leg"), np.array([0.0, 0.0, 0.03]))
    found = reach.move_limb(robot.standing, "left_leg", target)
    # `locate` places passive joints where their equality puts them.
    assert measure_miss(reach, found, "left_leg", target) < MILLIMETER
