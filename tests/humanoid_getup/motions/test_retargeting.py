"""Motions and keys on another body: the same angles or directions, as deep in the ground."""

from dataclasses import replace

import numpy as np
import pytest
from authored import load_robot_keyframes
from model_files import write_model

from humanoid_getup.motions.keyframes import Keyframes, KeyTransfer
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import (
    BODY,
    MOST_OVERLAP,
    Retargeting,
    find_motion,
    load_database,
)
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Body, Robot, load_robot, reshape
from robots.body.limbs import Limbs
from robots.kinematics import lowest_points, place, place_postures
from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.quaternion import Array


@pytest.fixture(scope="module")
def long(op3: Robot) -> Robot:
    return reshape(op3, Body(arms=1.6))


@pytest.fixture(scope="module")
def squat(op3: Robot) -> Motion:
    return find_motion(op3, "lateral_asymmetric_squat")


def measure_lowest(robot: Robot, motion: Motion) -> np.ndarray:
    model = World(robot).model
    arrays = motion.position, motion.orientation, motion.joint_pos
    return lowest_points(model, place_postures(robot, model, *arrays))


@pytest.mark.parametrize("text", ["shoulders=2.0", "arms=1.6,torso=2.2", "legs=0.8"])
def test_every_frame_reaches_as_deep_into_the_ground_as_before(op3, squat, text):
    robot = reshape(op3, Body.parse(text))
    found = Retargeting(robot).retarget(squat)
    assert measure_lowest(robot, found) == pytest.approx(measure_lowest(op3, squat), abs=1e-9)
    assert np.abs(found.position - squat.position)[:, 2].max() > 0.03
    assert np.array_equal(found.position[:, :2], squat.position[:, :2])


def test_entries_in_which_the_body_reaches_into_itself_are_left_out_unless_all_do(
    long: Robot, squat: Motion
):
    found, world = Retargeting(long).retarget(squat), World(long)
    for key in ("time", "orientation", "joint_pos", "joint_target"):
        assert np.array_equal(getattr(found, key), getattr(squat, key)), key
    assert (found.name, found.robot) == (squat.name, "op3")
    clearance = Clearance(world)
    depth = {
        k: clearance.measure_self_overlap(place(long, world.model, squat.posture(k)))
        for k in squat.entry_frames
    }
    assert set(found.entry_frames) == {k for k, d in depth.items() if d <= MOST_OVERLAP}
    assert 0 < len(found.entry_frames) < len(squat.entry_frames)
    worst = max(depth, key=depth.__getitem__)
    alone = replace(squat, entry=np.arange(len(squat.time)) == worst)
    assert np.array_equal(Retargeting(long).retarget(alone).entry, alone.entry)


def test_the_database_of_another_body_has_all_motions(op3: Robot, long: Robot):
    before, after = load_database(op3), load_database(long)
    assert [m.name for m in after.motions] == [m.name for m in before.motions]
    assert {m.provenance[BODY] for m in after.motions} == {"arms=1.6"}
    # Ten entry postures reach too deep into the longer arms.
    assert len(before) - len(after) == 10


MOST = 2.0  # degrees by which a limb may point elsewhere


@pytest.fixture(scope="module")
def keyframes(op3: Robot) -> dict[str, Keyframes]:
    return {each.name: each for each in load_robot_keyframes(op3)}


@pytest.fixture(scope="module")
def renamed(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """OP3 as imported from a model that names and orders its joints otherwise."""
    folder = tmp_path_factory.mktemp("gnome")
    model = write_model(folder / "gnome.xml", op3)
    write_robot(import_model(model, ImportOptions(name="gnome")), folder / "gnome")
    return load_robot(folder / "gnome")


def measure_error(source: Limbs, target: Limbs, key: Array, found: Array) -> float:
    """Measure by how much the worst of the upper and lower limbs points elsewhere [deg]."""
    wanted, got = source.measure(key), target.measure(found)
    cosines = [
        getattr(wanted[name], part) @ getattr(got[name], part)
        for name in wanted
        for part in ("upper", "lower")
    ]
    return float(np.degrees(np.arccos(np.clip(min(cosines), -1.0, 1.0))))


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("squat_to_stand", "renamed"),
        ("prone_push_up_gentle", "op3"),
        ("lateral_side_sit", "renamed"),
    ],
)
def test_limbs_point_as_those_of_the_source(name, target, op3, renamed, keyframes):
    transfer = KeyTransfer.between(op3, {"op3": op3, "renamed": renamed}[target])
    moved = transfer.transfer(keyframes[name])
    errors = [
        measure_error(transfer.source, transfer.target, key, found)
        for key, found in zip(keyframes[name].keys[:-1], moved.keys[:-1], strict=True)
    ]
    assert max(errors) < MOST
    assert moved.keys[-1] == pytest.approx(transfer.target.robot.standing.joint_pos)


def test_a_symmetric_motion_stays_symmetric(op3: Robot, renamed: Robot, keyframes):
    moved = KeyTransfer.between(op3, renamed).transfer(keyframes["supine_long_sit"])
    assert moved.mirrored.any()
    assert renamed.mirror_joints(moved.keys) == pytest.approx(moved.keys, abs=1e-9)


def test_times_grow_with_the_square_root_of_the_height(op3: Robot, keyframes):
    tall = replace(op3, standing_neck_height=4.0 * op3.standing_neck_height)
    transfer = KeyTransfer(Limbs(op3), Limbs(tall))
    assert transfer.time_scale == pytest.approx(2.0)
    own = keyframes["squat_to_stand"]
    assert transfer.transfer(own).duration == pytest.approx(2.0 * own.duration)
