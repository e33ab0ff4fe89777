"""Entry postures are found by a metric that is one and does not see where the robot faces."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mirror_images import mirror_posture

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import (
    MotionDatabase,
    find_motion,
    load_database,
    load_key,
)
from humanoid_getup.motions.posture_metric import (
    SEGMENT_WEIGHT,
    PostureMetric,
    align,
    aligned_orientation_distance,
    best_yaw,
)
from robots import Posture, Robot, load_robot, quaternion

ROBOT = load_robot("op3")
METRIC = PostureMetric.of(ROBOT)
FRAMES = 60


def wander(seed: int, symmetric: bool = False) -> Motion:
    """Make a motion that bends and turns smoothly between random postures."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, FRAMES)
    ends = quaternion.normalize(rng.normal(size=(2, 4)))
    joint_pos = np.linspace(*rng.uniform(ROBOT.lower, ROBOT.upper, size=(2, ROBOT.n)), FRAMES)
    orientation = quaternion.slerp(ends[0], ends[1], share)
    if symmetric:
        joint_pos = 0.5 * (joint_pos + ROBOT.mirror_joints(joint_pos))
        orientation = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), share)
    return Motion(
        name=f"wander_{seed}",
        robot="op3",
        start_class="supine",
        strategy="wander",
        time=share,
        position=np.zeros((FRAMES, 3)),
        orientation=orientation,
        joint_pos=joint_pos,
        joint_target=joint_pos,
        entry=share < 0.8,
    )


def lying(rng: np.random.Generator) -> Posture:
    return Posture(
        position=np.zeros(3),
        orientation=quaternion.normalize(rng.normal(size=4)),
        joint_pos=rng.uniform(ROBOT.lower, ROBOT.upper),
    )


@pytest.mark.parametrize("per_motion", [1, FRAMES])
def test_the_nearest_entry_postures_are_found_in_order(per_motion: int):
    motions = [wander(seed) for seed in range(16)]
    database = MotionDatabase(motions, METRIC)
    assert len(database) == 16 * 48
    rng = np.random.default_rng(0)
    for _ in range(10):
        posture = lying(rng)
        entries = [
            sorted(METRIC.between(posture, m.posture(int(k))) for k in m.entry_frames)[:per_motion]
            for m in motions
        ]
        found = database.select(posture, 5, per_motion)
        nearest = sorted(distance for some in entries for distance in some)[:5]
        assert [c.distance for c in found] == pytest.approx(nearest, abs=1e-9)
        for connection in found:
            assert connection.motion.entry[connection.frame]
            between = METRIC.between(posture, connection.posture)
            assert connection.distance == pytest.approx(between, abs=1e-9)


def test_a_motion_that_lies_down_is_never_joined():
    rise, down = wander(0), replace(wander(1), start_class="standing", end_class="supine")
    database = MotionDatabase([down, rise], METRIC)
    assert database.motions == (down, rise)
    assert {c.motion.name for c in database.select(down.posture(0), 5, FRAMES)} == {rise.name}
    with pytest.raises(ValueError, match="at least one motion that ends standing"):
        MotionDatabase([down], METRIC)


def test_a_posture_of_the_database_finds_itself_wherever_it_faces():
    motions = [wander(seed) for seed in range(5)]
    database = MotionDatabase(motions, METRIC)
    posture = motions[3].posture(20)
    turn = quaternion.from_yaw(2.0)
    moved = replace(
        posture,
        position=np.array([3.0, 1.0, 0.0]),
        orientation=quaternion.multiply(turn, posture.orientation),
    )
    best = database.select(moved)[0]
    assert (best.motion.name, best.frame) == ("wander_3", 20)
    assert best.distance < 1e-6


def with_motions(folder: Path, *motions: Motion) -> Robot:
    (folder / "motions").mkdir()
    for motion in motions:
        motion.save(folder / "motions" / f"{motion.name}.npz")
    return replace(ROBOT, folder=folder)


def test_a_motion_is_mirrored_at_load_unless_it_is_its_own_mirror_image(tmp_path: Path):
    robot = with_motions(tmp_path, wander(0), wander(1, symmetric=True))
    names = [motion.name for motion in load_database(robot).motions]
    assert names == ["wander_0", "wander_0_mirrored", "wander_1"]


def test_a_mirrored_fall_finds_the_mirrored_motion_at_the_same_frame(tmp_path: Path):
    database = load_database(with_motions(tmp_path, *(wander(seed) for seed in range(3))))
    rng = np.random.default_rng(2)
    for _ in range(10):
        posture = lying(rng)
        one = database.select(posture)[0]
        other = database.select(mirror_posture(ROBOT, posture))[0]
        assert one.motion.mirrored(ROBOT).name == other.motion.name
        assert (one.frame, pytest.approx(one.distance)) == (other.frame, other.distance)


def test_a_time_names_the_nearest_frame_of_a_motion_and_of_its_mirror_image(op3: Robot):
    motion = find_motion(op3, "squat_to_stand")
    for time, frame in ((0.0, 0), (0.099, 12), (0.103, 13)):
        key = load_key(f"motions:squat_to_stand@{time}", op3)
        assert motion.time[frame] == pytest.approx(time, abs=0.004)
        np.testing.assert_array_equal(key.posture.joint_pos, motion.joint_pos[frame])
    left, right = (
        load_key(f"motions:lateral_side_sit{side}@1", op3).posture for side in ("", "_mirrored")
    )
    np.testing.assert_array_equal(mirror_posture(op3, left).joint_pos, right.joint_pos)


seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-np.pi, np.pi)


def postures(seed: int, count: int) -> list[Posture]:
    rng = np.random.default_rng(seed)
    return [
        Posture(
            position=rng.normal(size=3),
            orientation=quaternion.normalize(rng.normal(size=4)),
            joint_pos=rng.uniform(ROBOT.lower, ROBOT.upper),
        )
        for _ in range(count)
    ]


def turned(posture: Posture, yaw: float) -> Posture:
    turn = quaternion.from_yaw(yaw)
    return replace(posture, orientation=quaternion.multiply(turn, posture.orientation))


@given(seeds)
def test_distance_is_symmetric_positive_and_obeys_the_triangle(seed: int):
    """Mirror images are as far apart as their originals."""
    a, b, c = postures(seed, 3)
    assert abs(METRIC.between(a, b) - METRIC.between(b, a)) < 1e-9
    assert METRIC.between(a, b) > 0.0
    assert METRIC.between(a, c) <= METRIC.between(a, b) + METRIC.between(b, c) + 1e-9
    mirrored = METRIC.between(mirror_posture(ROBOT, a), mirror_posture(ROBOT, b))
    assert abs(mirrored - METRIC.between(a, b)) < 1e-9


@given(seeds, angles)
def test_turning_and_shifting_on_the_ground_changes_nothing(seed: int, yaw: float):
    a, b = postures(seed, 2)
    moved = replace(turned(b, yaw), position=np.zeros(3))
    assert abs(METRIC.between(a, moved) - METRIC.between(a, b)) < 1e-9
    assert METRIC.between(a, turned(a, yaw)) < 1e-6
    negated = replace(b, orientation=-b.orientation)
    assert abs(METRIC.between(a, negated) - METRIC.between(a, b)) < 1e-9


def test_no_yaw_of_a_fine_search_beats_the_closed_form():
    yaws = np.linspace(-np.pi, np.pi, 20001)
    for seed in range(20):
        a, b = postures(seed, 2)
        q = quaternion.multiply(quaternion.from_yaw(yaws), b.orientation)
        tried = 0.5 * quaternion.angle_between(a.orientation, q)
        found = aligned_orientation_distance(a.orientation, b.orientation)
        assert 0.0 <= tried.min() - found < 1e-7
        best = best_yaw(b.orientation, a.orientation)
        assert abs(np.angle(np.exp(1j * (yaws[tried.argmin()] - best)))) < 1e-3


def test_the_distance_worked_out_by_hand():
    # Knee (weight 1) off by 0.3, head pan (0.5) by 0.4, tilted by 0.2 rad:
    # 5 * 0.1 + sqrt(0.3^2 + 0.5 * 0.4^2) = 0.5 + sqrt(0.17)
    a = ROBOT.standing
    joint_pos = a.joint_pos.copy()
    joint_pos[ROBOT.joint_names.index("l_knee")] += 0.3
    joint_pos[ROBOT.joint_names.index("head_pan")] += 0.4
    tilt = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.2)
    b = replace(a, orientation=quaternion.multiply(tilt, a.orientation), joint_pos=joint_pos)
    assert abs(METRIC.between(a, b) - (0.5 + np.sqrt(0.17))) < 1e-9


def test_a_segment_weighs_what_the_paper_says():
    """[Lin12], section 5: a foot 0.7, the head 0.5, other segments of this robot 1."""
    a = ROBOT.standing
    weights = {"l_ank_pitch": 0.7, "r_ank_roll": 0.7, "head_tilt": 0.5, "r_knee": 1.0}
    for joint, weight in weights.items():
        joint_pos = a.joint_pos.copy()
        joint_pos[ROBOT.joint_names.index(joint)] += 0.3
        distance = METRIC.between(a, replace(a, joint_pos=joint_pos))
        assert distance == pytest.approx(np.sqrt(weight) * 0.3, abs=1e-12)
    names = ("wrist", "hand", "finger", "thumb", "toes")
    assert [SEGMENT_WEIGHT[name] for name in names] == [0.5, 0.3, 0.1, 0.1, 0.1]


@given(seeds)
def test_an_aligned_posture_is_turned_by_the_best_yaw_and_keeps_its_height(seed: int):
    a, b = postures(seed, 2)
    aligned = align(b, a)
    np.testing.assert_allclose(aligned.position, [*a.position[:2], b.position[2]])
    left = 0.5 * quaternion.angle_between(a.orientation, aligned.orientation)
    assert abs(left - aligned_orientation_distance(a.orientation, b.orientation)) < 1e-9
    np.testing.assert_allclose(aligned.gravity_b, b.gravity_b, atol=1e-9)
