"""From where a robot fell to where a motion takes over, through nothing solid."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.motions.posture_metric import PostureMetric, align
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.path_planner import SPEED_SHARE, PathOptions, PathResult, plan_path
from humanoid_getup.planning.posture_space import PostureProblem
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchStatus
from humanoid_getup.scenes.obstacle import make_capsule
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.world import World
from robots import Posture, load_robot, quaternion
from robots.kinematics import lowest_point, place
from robots.quaternion import Array

ROBOT = load_robot("op3")
FLAT = FLAT_SCENE
METRIC = PostureMetric.of(ROBOT)
X, Y = np.eye(3)[:2]


@pytest.fixture(scope="module")
def checker() -> CollisionChecker:
    return CollisionChecker(ROBOT, FLAT)


@pytest.fixture(scope="module")
def goals() -> list[Posture]:
    """Lay the stance down on its back, its front and its sides."""
    turns = [(Y, -1.0), (Y, 1.0), (X, 1.0), (X, -1.0)]
    return [_rest(quaternion.from_axis_angle(axis, sign * np.pi / 2)) for axis, sign in turns]


def _rest(orientation: Array, joint_pos: Array = ROBOT.standing.joint_pos) -> Posture:
    up = np.array([0.0, 0.0, 0.3])
    posture = Posture(position=up, orientation=orientation, joint_pos=joint_pos)
    model = FLAT.compile(ROBOT)
    lowest = np.array([0.0, 0.0, lowest_point(model, place(ROBOT, model, posture)) + 0.001])
    return replace(posture, position=up - lowest)


@pytest.fixture(scope="module")
def starts() -> list[Posture]:
    world = World(ROBOT, FLAT)
    falls = sample_falls(world, {"supine": 2, "prone": 2, "lateral": 2}, np.random.default_rng(0))
    return [fall.posture for fall in falls]


@pytest.fixture(scope="module")
def plans(
    checker: CollisionChecker, starts: list[Posture], goals: list[Posture]
) -> list[PathResult]:
    return [
        plan_path(start, align(_nearest(start, goals), start), checker, np.random.default_rng(seed))
        for seed, start in enumerate(starts)
    ]


def _nearest(start: Posture, goals: list[Posture]) -> Posture:
    return min(goals, key=lambda goal: METRIC.between(start, goal))


def depths(model: mujoco.MjModel, data: mujoco.MjData, posture: Posture) -> dict:
    layout = ROBOT.layout(model)
    root = layout.root_qpos
    data.qpos[root : root + 3] = posture.position
    data.qpos[root + 3 : root + 7] = posture.orientation
    data.qpos[layout.qpos] = posture.joint_pos
    mujoco.mj_forward(model, data)
    found: dict = {}
    for contact in data.contact:
        pair = tuple(sorted(contact.geom.tolist()))
        found[pair] = max(found.get(pair, 0.0), -contact.dist)
    return found


def test_every_fall_is_planned_from_start_to_goal(plans, starts, goals):
    assert len(plans) == 6
    for plan, start in zip(plans, starts, strict=True):
        assert plan.status is SearchStatus.SOLVED
        np.testing.assert_allclose(plan.trajectory.joint_pos[0], start.joint_pos, atol=1e-9)
        goal = align(_nearest(start, goals), start)
        np.testing.assert_allclose(plan.trajectory.joint_pos[-1], goal.joint_pos, atol=1e-9)
        np.testing.assert_allclose(plan.trajectory.position[0], start.position, atol=1e-6)
        turn = quaternion.angle_between(plan.trajectory.orientation[-1], goal.orientation)
        assert turn < 1e-6


def test_nothing_on_the_way_is_deeper_than_allowed_or_beyond_a_limit(plans, starts, goals):
    model = FLAT.compile(ROBOT)
    data = mujoco.MjData(model)
    ground = model.geom("ground").id
    checked = 0
    for plan, start in zip(plans, starts, strict=True):
        rest = depths(model, data, start)
        for pair, depth in depths(model, data, align(_nearest(start, goals), start)).items():
            rest[pair] = max(rest.get(pair, 0.0), depth)
        trajectory = plan.trajectory
        assert np.all(trajectory.joint_pos >= ROBOT.lower - 1e-9)
        assert np.all(trajectory.joint_pos <= ROBOT.upper + 1e-9)
        speed = np.abs(np.diff(trajectory.joint_pos, axis=0)) / ROBOT.control_period
        assert np.all(speed <= SPEED_SHARE * ROBOT.max_velocity * (1.0 + 1e-6))
        for k in range(len(trajectory.time)):
            for pair, depth in depths(model, data, trajectory.posture(k)).items():
                tolerance = 0.003 if ground in pair else 0.001
                assert depth <= max(tolerance, rest.get(pair, 0.0) + 0.25e-3) + 0.5e-3
                checked += 1
    assert checked > 500


def pose(checker: CollisionChecker, start: Posture, goal: Posture) -> PostureProblem:
    goal = align(goal, start)
    checker.reset()
    assert checker.allow(start) == checker.allow(goal) == ""
    return PostureProblem(checker, METRIC, start, goal, np.stack([start.position, goal.position]))


def test_a_start_in_the_ground_and_a_goal_in_the_ground_are_distinguished(checker, goals):
    sunk = replace(goals[0], position=goals[0].position - np.array([0.0, 0.0, 0.03]))
    rng = np.random.default_rng(0)
    start = plan_path(sunk, goals[0], checker, rng)
    assert (start.status, start.trajectory) == (SearchStatus.START_INVALID, None)
    assert "inside 'ground'" in start.reason
    goal = plan_path(goals[0], sunk, checker, rng)
    assert goal.status is SearchStatus.GOAL_INVALID
    assert goal.trajectory is None


def test_a_spent_budget_is_an_answer_with_a_reason(checker, starts, goals):
    stingy = PathOptions(search=SearchOptions(max_edges=1), refine_edges=1)
    answer = plan_path(starts[0], goals[1], checker, np.random.default_rng(0), stingy)
    assert answer.status is SearchStatus.BUDGET_SPENT
    assert answer.reason != ""


def test_arms_swing_around_a_beam_that_bars_their_way(goals: list[Posture]):
    # A beam lies across a robot on its back, above its shoulders and within reach: straight
    # arms that swing from its sides to over its head would hit it.
    ends = np.array([[-0.11, -0.5, 0.30], [-0.11, 0.5, 0.30]])
    beam = make_capsule("beam", ends[0], ends[1], 0.03)
    checker = CollisionChecker(ROBOT, Scene(name="beam", obstacles=(beam,)))
    swing = np.zeros((2, ROBOT.n))
    for joint, sign in (("l_sho_pitch", 1.0), ("r_sho_pitch", -1.0)):
        swing[:, ROBOT.joint_names.index(joint)] = sign * np.array([-0.8, -2.4])
    for side, sign in (("l", 1.0), ("r", -1.0)):
        swing[:, ROBOT.joint_names.index(f"{side}_sho_roll")] = sign * 1.4
    start, goal = (_rest(goals[0].orientation, bent) for bent in swing)
    problem = pose(checker, start, goal)
    assert problem.fails(problem.start, problem.goal)
    plan = plan_path(start, goal, checker, np.random.default_rng(0))
    assert plan.status is SearchStatus.SOLVED
    # The detour moves joints that a straight path would leave alone.
    moved = np.ptp(plan.trajectory.joint_pos, axis=0) > 0.01
    assert np.any(moved & (start.joint_pos == goal.joint_pos))
