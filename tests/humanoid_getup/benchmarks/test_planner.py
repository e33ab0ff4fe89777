"""Path planners beside each other: same problems, same checks, same budget."""

from collections.abc import Callable

import numpy as np
import pytest

from humanoid_getup.benchmarks.limited_checker import Budget, BudgetSpentError
from humanoid_getup.benchmarks.ompl_planners import OMPL_PLANNERS
from humanoid_getup.benchmarks.planner import ALL, bench_planner, compare
from humanoid_getup.benchmarks.planning_problems import OWN_PLANNERS, ProblemMaker, is_free_path
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.posture_space import PostureProblem
from humanoid_getup.scenes.start_region import lying
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import place, read_posture

PLANNERS = OWN_PLANNERS | OMPL_PLANNERS
SMALL = Budget(checks=3000)

Pose = Callable[[int], PostureProblem]


@pytest.fixture(scope="module")
def maker(op3: Robot) -> ProblemMaker:
    return ProblemMaker(World(op3, "beam"))


@pytest.fixture(scope="module")
def pose(op3: Robot, maker: ProblemMaker) -> Pose:
    """Pose the problem of a fall on the beam, each time with a checker that forgot the others."""
    falls = sample_falls(maker.world, {"prone": 2}, np.random.default_rng(3))
    goals = [[c.posture for c in load_database(op3).select(f.posture, 9)] for f in falls]

    def pose_one(number: int) -> PostureProblem:
        rng = np.random.default_rng(0)
        problem = maker.pose_nearest(falls[number].posture, goals[number], rng)
        assert problem is not None
        return problem

    return pose_one


@pytest.mark.parametrize("name", PLANNERS)
def test_a_path_is_free_and_leads_from_start_to_goal(pose: Pose, maker: ProblemMaker, name: str):
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


@pytest.mark.parametrize("name", PLANNERS)
def test_the_same_seed_searches_the_same_and_another_something_else(
    pose: Pose, maker: ProblemMaker, name: str
):
    one, same, other = (maker.attempt(pose(1), PLANNERS[name], seed, SMALL) for seed in (7, 7, 8))
    assert (one.checks, one.length, len(one.path)) == (same.checks, same.length, len(same.path))
    assert np.array_equal(one.path, same.path)
    assert one.checks != other.checks


@pytest.mark.parametrize("name", PLANNERS)
def test_a_search_ends_with_its_budget(pose: Pose, maker: ProblemMaker, name: str):
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


def test_a_goal_on_the_table_is_not_one_under_it(op3: Robot):
    """A robot stands on the table, but not under it."""
    world = World(op3, "table")
    maker, flat = ProblemMaker(world), World(op3)
    start = _lay(flat, op3.standing.joint_pos * 0.0)
    rng = np.random.default_rng(0)
    assert maker.rest_at(start, op3.standing).position[2] > op3.standing_neck_height
    assert maker.pose_nearest(start, [op3.standing], rng) is None
    assert maker.pose_nearest(start, [op3.standing, start], rng) is not None


def _lay(world: World, joint_pos: np.ndarray) -> Posture:
    robot = world.robot
    posture = Posture(position=np.zeros(3), orientation=lying("supine"), joint_pos=joint_pos)
    qpos = Clearance(world).rest(place(robot, world.model, posture))
    return read_posture(robot, world.model, qpos)


def test_all_planners_meet_the_same_problems(op3: Robot):
    seen = []
    options = {"seed": 2, "each": 2, "scenes": ["beam"], "budget": SMALL}
    result = bench_planner(op3, PLANNERS, **options, report=seen.append)
    again = bench_planner(op3, PLANNERS, **options)
    assert len(seen) == 2
    assert result["problems"] == [record for fall in seen for record in fall]
    for record, same in zip(result["problems"], again["problems"], strict=True):
        for key in ("fall", "found", "checks", "length"):
            assert record[key] == same[key], record
    for name in PLANNERS:
        for scene in ("beam", ALL):
            assert result["cases"][f"{scene}: {name}"]["n"] == 2 - result["skipped"]["beam"]


def test_times_are_compared_where_both_planners_find_a_path():
    def record(planner: str, fall: int, found: bool, time: float) -> dict:
        figures = {"time_s": time, "checks": 10, "length": 2.0 if found else None}
        return {"case": "beam", "planner": planner, "fall": fall, "found": found} | figures

    records = [
        record("RRTConnect", 0, True, 1.0),
        record("strict", 0, True, 0.5),
        record("RRTConnect", 1, True, 2.0),
        record("strict", 1, False, 9.0),
        record("RRTConnect", 2, False, 4.0),
        record("strict", 2, True, 1.0),
    ]
    summary = compare(records, "beam", "strict")
    assert (summary["n"], summary["found"], summary["both"]) == (3, 2, 1)
    assert summary["time_s_ratio"] == 0.5
    assert summary["time_s"]["median"] == 1.0  # of all three
    assert summary["length_median"] == 2.0
    assert compare(records, ALL, "RRTConnect")["time_s_ratio"] == 1.0
    alone = compare(records[1::2], "beam", "strict")
    assert (alone["both"], alone["time_s_ratio"]) == (0, None)
