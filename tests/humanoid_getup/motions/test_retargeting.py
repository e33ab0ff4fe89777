"""Motions on another body: the same angles, as deep in the ground as before."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion, load_database
from humanoid_getup.motions.retargeting import BODY, MOST_OVERLAP, Retargeting
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Body, Robot, reshape
from robots.kinematics import lowest_points, place, place_postures


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
