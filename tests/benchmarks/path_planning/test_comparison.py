"""Path planners beside each other: same problems, same checks, same budget."""

from collections.abc import Callable

import numpy as np
import pytest
from path_planning.limited_checker import Budget, BudgetSpentError
from path_planning.ompl_planners import OMPL_PLANNERS
from path_planning.planning_problems import (
    OWN_PLANNERS,
    ProblemMaker,
    is_free_path,
)

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.posture_space import PostureProblem
from humanoid_getup.simulation.world import World
from robots import Robot

PLANNERS = OWN_PLANNERS | OMPL_PLANNERS
SMALL = Budget(checks=3000)

Pose = Callable[[int], PostureProblem]


@pytest.fixture(scope="module")
def maker(op3: Robot) -> ProblemMaker:
    return ProblemMaker(World(op3, "beam"))


@pytest.fixture(scope="module")
def pose(op3: Robot, maker: ProblemMaker) -> Pose:
    """Pose the problem of a fall on the beam, each time with a checker that forgot the others."""
    falls = sample_falls(maker.world, {"prone": 2}, np.random.default_rng(6))
    goals = [[c.posture for c in load_database(op3).select(f.posture, 9)] for f in falls]

    def pose_one(number: int) -> PostureProblem:
        rng = np.random.default_rng(0)
        problem = maker.pose_nearest(falls[number].posture, goals[number], rng)
        assert problem is not None
        return problem

    return pose_one


@pytest.mark.parametrize("name", PLANNERS)
def test_a_path_is_free_leads_from_start_to_goal_and_is_that_of_its_seed_and_budget(
    pose: Pose, maker: ProblemMaker, name: str
):
    found = 0
    for number in (0, 1):
        problem = pose(number)
        path = maker.attempt(problem, PLANNERS[name], 5, Budget()).path
        if path:
            found += 1
            assert is_free_path(problem, path)
            for node, end in ((path[0], problem.start), (path[-1], problem.goal)):
                assert abs(node[:4] @ end[:4]) == pytest.approx(1.0)
                assert node[4:] == pytest.approx(end[4:])
    assert found > 0
    one, same, other = (maker.attempt(pose(0), PLANNERS[name], seed, SMALL) for seed in (7, 7, 8))
    assert (one.checks, one.length, len(one.path)) == (same.checks, same.length, len(same.path))
    assert np.array_equal(one.path, same.path)
    assert one.checks != other.checks
    attempt = maker.attempt(pose(1), PLANNERS[name], 5, Budget(checks=30))
    assert not attempt.path
    assert attempt.length is None
    assert 30 <= attempt.checks <= 32  # a posture that is lifted is checked three times


def test_a_search_ends_after_its_time(pose: Pose, maker: ProblemMaker):
    problem = pose(0)
    maker.checker.grant(Budget(time=0.0))
    with pytest.raises(BudgetSpentError):
        problem.is_free(problem.start)
    maker.checker.grant(None)
    assert problem.is_free(problem.start)
