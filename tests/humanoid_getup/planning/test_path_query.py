"""A path query takes the first goal with a path, and else says which attempt came furthest."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.starts.falls import sample_fall
from humanoid_getup.motions.motion import NO_END, Trajectory
from humanoid_getup.motions.motion_database import Connection, load_database
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning import path_query
from humanoid_getup.planning.path_planner import PathOptions
from humanoid_getup.planning.path_query import (
    Goal,
    PathAnswer,
    choose_goals,
    find_path,
    measure_length,
    to_motion,
)
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.planning.via import ViaResult
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion

SPENT, SOLVED, BAD_START = (
    SearchStatus.BUDGET_SPENT,
    SearchStatus.SOLVED,
    SearchStatus.START_INVALID,
)


@pytest.fixture(scope="module")
def lying(world: World) -> Posture:
    return sample_fall(world, "prone", seed=4).posture


def course(robot: Robot, turn: float, bend: float) -> Trajectory:
    """Turn a robot about the vertical by an angle, and bend each joint by another, in 1 s."""
    ends = robot.standing.joint_pos + np.array([[0.0], [bend]])
    return Trajectory(
        time=np.array([0.0, 1.0]),
        position=np.zeros((2, 3)),
        orientation=np.array([quaternion.IDENTITY, quaternion.from_yaw(turn)]),
        joint_pos=ends,
    )


def ask(world: World, start: Posture, monkeypatch, *results: ViaResult) -> PathAnswer:
    """Ask for a path to goals a, b and so on, searches for which end as given."""
    ends = iter(results)
    monkeypatch.setattr(path_query, "plan_via", lambda *_: next(ends))
    goals = [Goal(name=name, posture=start) for name in "abcd"[: len(results)]]
    return find_path(world, start, [], goals, np.random.default_rng(0), PathOptions())


def failed(leg: int, beginning: Trajectory | None = None, status=SPENT) -> ViaResult:
    reason = "" if status is SOLVED else f"leg {leg}"
    return ViaResult(status=status, reason=reason, leg=leg, beginning=beginning, nodes=10)


def test_the_first_goal_with_a_path_is_the_answer(world, op3, lying, monkeypatch):
    path = course(op3, 0.1, 0.1)
    solved = ViaResult(status=SOLVED, leg=1, trajectory=path, nodes=5)
    answer = ask(world, lying, monkeypatch, failed(1, course(op3, 2.0, 2.0)), solved, failed(1))
    assert answer.found
    assert (answer.goal.name, answer.path) == ("b", path)
    assert answer.tried == (("a", "leg 1"), ("b", ""))
    assert answer.nodes == 15


def test_a_start_that_is_not_valid_is_tried_once(world, lying, monkeypatch):
    answer = ask(world, lying, monkeypatch, failed(1, status=BAD_START), failed(1), failed(1))
    assert not answer.found
    assert (answer.goal.name, answer.path, answer.tried) == ("a", None, (("a", "leg 1"),))


def test_without_a_path_the_attempt_that_came_furthest_is_the_answer(
    world, op3, lying, monkeypatch
):
    """By legs first, and then by the length of the beginning, not by the time that it takes."""
    short, long = course(op3, 0.1, 0.0), course(op3, 0.1, 0.4)
    slow = replace(short, time=10.0 * short.time)
    answer = ask(
        world, lying, monkeypatch, failed(2, slow), failed(1, long), failed(2, long), failed(2)
    )
    assert (answer.goal.name, answer.found) == ("c", False)
    assert answer.path is long
    assert [name for name, _ in answer.tried] == ["a", "b", "c", "d"]
    assert answer.nodes == 40


def test_a_goal_without_a_place_is_not_searched_for(world, lying, monkeypatch):
    monkeypatch.setattr(path_query, "place_stops", lambda *_: [None])
    answer = ask(world, lying, monkeypatch, failed(1))
    assert answer.result.status is SearchStatus.GOAL_INVALID
    assert answer.tried == (("a", "there is no place for a at the robot or beside it"),)
    assert (answer.nodes, answer.result.leg) == (0, 1)


def test_a_path_is_as_long_as_its_turns_and_bends_in_the_metric(op3: Robot):
    """By hand: half the angle by the root's weight, and each joint by its own."""
    metric = PostureMetric.of(op3)
    bent = 0.3 * np.sqrt(metric.joint_weight.sum())
    assert measure_length(metric, course(op3, 0.8, 0.3)) == pytest.approx(
        0.4 * metric.root_weight + bent
    )
    assert measure_length(metric, course(op3, 0.0, 0.0)) == 0.0


def test_goals_are_the_frames_that_are_nearest(op3: Robot, lying: Posture):
    database = load_database(op3)
    goals = choose_goals(database, lying)
    assert len(goals) == 6
    away = [database.metric.between(lying, goal.posture) for goal in goals]
    assert away == sorted(away)
    for goal in goals:
        assert goal.connection is not None
        assert goal.name == goal.connection.motion.name


@pytest.mark.parametrize("is_joined", [True, False])
def test_a_path_is_a_motion_that_says_where_it_leads(world, op3, lying, monkeypatch, is_joined):
    joined = next(m for m in load_database(op3).motions if m.name == "squat_to_stand")
    connection = Connection(joined, 3, 0.5) if is_joined else None
    path = course(op3, 0.2, 0.1)
    answer = ask(world, lying, monkeypatch, failed(1, path))
    answer = replace(answer, goal=replace(answer.goal, connection=connection))
    motion = to_motion(world, path, answer, seed=7)
    assert (motion.name, motion.strategy, motion.end_class) == ("path", "path to a", NO_END)
    assert motion.start_class == "squat"  # it is upright
    np.testing.assert_array_equal(motion.joint_target, path.joint_pos)
    assert motion.provenance["complete"] == 0
    assert motion.provenance["seed"] == 7
    assert motion.provenance.get("frame") == (3 if is_joined else None)
    if is_joined:
        assert motion.provenance["frame_time_s"] == pytest.approx(joined.time[3])
