"""Answers to path queries: how long a path is, and the motion that it makes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.commands.plan.plan_path import (
    Goal,
    PathAnswer,
    measure_length,
    to_motion,
)
from humanoid_getup.filtering.candidate import straight_path
from humanoid_getup.motions.motion import NO_END
from humanoid_getup.motions.motion_database import Connection, KeyPosture, load_key, name_keys
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker, check_keys
from humanoid_getup.planning.key_path import KEY_REST, place_stops, plan_via
from humanoid_getup.planning.path_planner import PathOptions, PathResult
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.simulation.world import World
from robots import Posture, Robot


def answer(world: World, joined: Connection) -> PathAnswer:
    path = straight_path(joined.motion.posture(0), joined.posture, 2.0, world.robot.control_period)
    return PathAnswer(
        status=SearchStatus.SOLVED,
        leg=1,
        trajectory=path,
        goal=Goal(name="there", posture=joined.posture, connection=joined),
        way_out=None,
        tried=(("there", ""),),
        checks=0,
        time=0.0,
    )


def test_the_length_of_a_straight_path_is_the_distance_of_its_ends(world: World, database):
    motion = database.rising[0]
    still = straight_path(motion.posture(0), motion.posture(0), 1.0, 0.01)
    metric = PostureMetric.of(world.robot)
    assert measure_length(metric, still) < 1e-12
    path = straight_path(motion.posture(0), motion.posture(30), 1.0, 0.01)
    joints = np.sqrt(np.sum(metric.joint_weight * (path.joint_pos[-1] - path.joint_pos[0]) ** 2))
    dot = abs(float(path.orientation[0] @ path.orientation[-1]))
    turned = metric.root_weight * np.arccos(min(dot, 1.0))
    assert joints <= measure_length(metric, path) == pytest.approx(joints + turned, rel=1e-4)


def test_a_path_is_a_motion_without_an_end_that_says_where_it_leads(world, database):
    motion = database.rising[0]
    joined = Connection(motion, 40, 0.0)
    found = answer(world, joined)
    assert found.found and found.trajectory is not None
    made = to_motion(world, found.trajectory, found, seed=7)
    assert (made.end_class, made.start_class) == (NO_END, motion.start_class)
    np.testing.assert_array_equal(made.joint_target, found.trajectory.joint_pos)
    assert made.provenance["goal"] == "there"
    assert made.provenance["seed"] == 7
    assert made.provenance["frame_time_s"] == pytest.approx(float(motion.time[40]))


NAMES = ("supine_sit_up_gentle@1.2", "supine_roll_over@1", "squat_to_stand@0")


@pytest.fixture(scope="module")
def stops(world: World, op3: Robot, supine: Posture) -> list[Posture]:
    keys = [load_key(f"motions:{name}", op3).posture for name in NAMES]
    placed = place_stops(world, keys, supine)
    assert all(stop is not None for stop in placed)
    return [stop for stop in placed if stop is not None]


def plan(
    world: World, supine: Posture, stops: Sequence[Posture], options: PathOptions | None = None
) -> PathResult:
    checker = CollisionChecker(world.robot, world.scene)
    return plan_via(supine, stops, checker, np.random.default_rng(0), options)


@pytest.fixture(scope="module")
def found(world: World, supine: Posture, stops: list[Posture]) -> PathResult:
    return plan(world, supine, stops)


def test_the_path_passes_through_every_key_in_order_and_rests_there(op3, found, stops):
    path = found.trajectory
    assert found.status is SearchStatus.SOLVED
    assert len(found.arrivals) == 2
    assert list(found.arrivals) == sorted(found.arrivals)
    for arrival, stop in zip((*found.arrivals, -1), stops, strict=True):
        np.testing.assert_allclose(path.joint_pos[arrival], stop.joint_pos, atol=1e-9)
        assert abs(path.orientation[arrival] @ stop.orientation) == pytest.approx(1.0)
    np.testing.assert_allclose(np.diff(path.time), op3.control_period)
    for arrival in found.arrivals:
        still = path.joint_pos[arrival - round(KEY_REST / op3.control_period) : arrival + 1]
        assert len(still) > 30
        np.testing.assert_array_equal(still, still[:1].repeat(len(still), axis=0))


def test_what_was_planned_before_a_leg_without_a_path_is_kept(world, op3, supine, stops):
    joint_pos = op3.standing.joint_pos.copy()
    joint_pos[op3.joint_names.index("l_hip_roll")] = 0.5  # one leg in the other
    crossed = Posture(
        position=op3.standing.position, orientation=op3.standing.orientation, joint_pos=joint_pos
    )
    found = plan(world, supine, [stops[0], crossed, stops[-1]])
    assert (found.status, found.leg) == (SearchStatus.GOAL_INVALID, 2)
    assert "mm inside" in found.reason
    assert found.trajectory is None
    np.testing.assert_allclose(found.beginning.joint_pos[-1], stops[0].joint_pos, atol=1e-9)


def bend(robot: Robot, joint: str, angle: float) -> Posture:
    angles = robot.standing.joint_pos.copy()
    angles[robot.joint_names.index(joint)] = angle
    return replace(robot.standing, joint_pos=angles)


def test_a_posture_may_be_anywhere_even_in_the_ground(op3: Robot):
    sunk = replace(op3.standing, position=np.array([5.0, 0.0, -3.0]))
    check_keys(op3, name_keys([sunk, op3.standing]))


def test_every_key_that_is_wrong_is_named(op3: Robot):
    short = replace(op3.standing, joint_pos=op3.standing.joint_pos[:3])
    keys = [
        KeyPosture(name="bent", posture=bend(op3, "l_knee", 3.5)),
        KeyPosture(name="fine", posture=op3.standing),
        KeyPosture(name="crossed", posture=bend(op3, "l_hip_roll", 0.5)),
        KeyPosture(name="short", posture=short),
    ]
    with pytest.raises(ValueError) as refusal:
        check_keys(op3, keys)
    bent, crossed, shape = str(refusal.value).split("; posture ")
    assert bent.startswith("posture bent: joint 'l_knee' is +3.500 rad, expected [")
    assert crossed.startswith("crossed: ") and "mm inside" in crossed
    assert shape == f"short: joint_pos is (3,), expected ({op3.n},)"
