"""Answers to path queries: how long a path is, and the motion that it makes."""

import numpy as np
import pytest

from humanoid_getup.filtering.reference import straight_path
from humanoid_getup.motions.motion import NO_END
from humanoid_getup.motions.motion_database import Connection, load_database
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.path_query import (
    CONNECTIONS,
    Goal,
    PathAnswer,
    choose_goals,
    measure_length,
    to_motion,
)
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.planning.via import ViaResult
from humanoid_getup.simulation.world import World


@pytest.fixture(scope="module")
def database(world: World):
    return load_database(world.robot)


def answer(world: World, joined: Connection, *, solved: bool) -> PathAnswer:
    path = straight_path(joined.motion.posture(0), joined.posture, 2.0, world.robot.control_period)
    result = ViaResult(
        status=SearchStatus.SOLVED if solved else SearchStatus.BUDGET_SPENT,
        leg=1,
        trajectory=path if solved else None,
        beginning=None if solved else path,
    )
    return PathAnswer(
        goal=Goal(name="there", posture=joined.posture, connection=joined),
        result=result,
        way_out=None,
        tried=(("there", result.reason),),
        nodes=0,
        checks=0,
        time=0.0,
    )


def test_goals_are_the_nearest_entries_of_different_motions(database):
    start = database.rising[0].posture(0)
    goals = choose_goals(database, start)
    assert len(goals) == CONNECTIONS == len({goal.name for goal in goals})
    assert goals[0].connection is not None and goals[0].connection.distance < 1e-6
    apart = [database.metric.between(start, goal.posture) for goal in goals]
    assert apart == sorted(apart)


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


@pytest.mark.parametrize("solved", [True, False])
def test_a_path_is_a_motion_without_an_end_that_says_where_it_leads(
    world: World, database, solved: bool
):
    motion = database.rising[0]
    joined = Connection(motion, 40, 0.0)
    found = answer(world, joined, solved=solved)
    assert found.found is solved and found.path is not None
    made = to_motion(world, found.path, found, seed=7)
    assert (made.end_class, made.start_class) == (NO_END, motion.start_class)
    np.testing.assert_array_equal(made.joint_target, found.path.joint_pos)
    assert made.provenance["goal"] == "there"
    assert (made.provenance["complete"], made.provenance["seed"]) == (int(solved), 7)
    assert made.provenance["frame_time_s"] == pytest.approx(float(motion.time[40]))
