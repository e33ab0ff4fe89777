"""Entry postures are found by the metric, in mirrored motions too, and key postures by a time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mirror_images import mirror_posture

from humanoid_getup.motions.key_posture import load_key
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MotionDatabase, find_motion, load_database
from humanoid_getup.motions.posture_metric import PostureMetric
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
