"""The space in which a path is searched: steps, distances and ways, by independent arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.posture_space import (
    RESOLUTION,
    PointProblem,
    PostureProblem,
    blossom,
)
from humanoid_getup.scenes.obstacle import make_capsule
from humanoid_getup.scenes.scene import FLAT_SCENE
from robots import Posture, load_robot, quaternion

ROBOT = load_robot("op3")
FLAT = FLAT_SCENE
METRIC = PostureMetric.of(ROBOT)
PATH = np.array([[0.0, 0.0, 0.3], [0.3, 0.0, 0.3], [0.3, 0.1, 0.3]])
"""Where the root goes: 0.3 m ahead, then 0.1 m to the side."""
START = Posture(
    position=PATH[0], orientation=quaternion.IDENTITY, joint_pos=ROBOT.standing.joint_pos
)
QUARTER = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.pi / 2)
GOAL = replace(
    START, position=PATH[-1], orientation=QUARTER, joint_pos=ROBOT.standing.joint_pos + 0.2
)

# Each component of the direction, the one ahead included, changes by up to tan 15 deg.
MOST_SIDEWAYS = np.tan(np.radians(15.0)) / (1.0 - np.tan(np.radians(15.0)))


@pytest.fixture(scope="module")
def problem() -> PostureProblem:
    return PostureProblem(CollisionChecker(ROBOT, FLAT), METRIC, START, GOAL, PATH)


def node(turn: float, bend: float) -> np.ndarray:
    """The start, turned about x by an angle [rad] and with each joint bent by another."""
    q = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), turn)
    return np.concatenate([q, START.joint_pos + bend])


def test_distances_are_those_of_the_metric(problem):
    nodes = np.array([node(0.3, 0.1), node(-1.0, 0.0), node(0.0, -0.2)])
    expected = [
        METRIC.root_weight * abs(turn) / 2 + abs(bend) * np.sqrt(METRIC.joint_weight.sum())
        for turn, bend in ((0.3, 0.1), (-1.0, 0.0), (0.0, -0.2))
    ]
    assert problem.distance(nodes, problem.start) == pytest.approx(expected)


def test_steps_far_from_the_target_have_the_full_length_and_blossom_by_15_degrees(problem):
    rng, target = np.random.default_rng(0), node(2.0, 0.0)
    target[4:] = np.where(np.arange(ROBOT.n) % 2, problem.lower, problem.upper)
    bends, turns = [], []
    for _ in range(200):
        steps = problem.steer(problem.start, target, problem.goal, 4, rng)
        apart = (steps[:, 4:] - START.joint_pos) * problem.scale
        free = np.all((steps[:, 4:] > problem.lower) & (steps[:, 4:] < problem.upper), axis=1)
        np.testing.assert_allclose(np.linalg.norm(apart[free], axis=1), 2.0)
        assert np.all(np.linalg.norm(apart, axis=1) <= 2.0 + 1e-9)
        half = np.arccos(steps[:, 0])
        np.testing.assert_allclose(half, 0.4)
        turns += list(steps[1:, 1] / np.sin(half[1:]))
        way = steps[:, 1:4] / np.sin(half)[:, None]
        np.testing.assert_allclose(way[0], [1.0, 0.0, 0.0], atol=1e-12)
        bends += list(np.abs(way[1:, 1:] / way[1:, :1]).ravel())
        assert steps.shape == (4, 4 + ROBOT.n)
    assert max(bends) <= MOST_SIDEWAYS + 1e-9
    assert max(bends) > np.tan(np.radians(13.0))
    assert min(turns) < 0.97


@pytest.mark.parametrize("bend", [0.3, 1.9])
def test_a_target_within_a_step_is_reached_bit_for_bit(problem, bend):
    """``bend`` is in dis_V. What is reached is held, and only what is equal counts as reached."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        way = rng.normal(size=ROBOT.n)
        target = node(0.3, 0.0)
        target[4:] = np.clip(
            START.joint_pos + bend * way / np.linalg.norm(problem.scale * way),
            problem.lower,
            problem.upper,
        )
        step = problem.steer(problem.start, target, problem.goal, 2, rng)[0]
        np.testing.assert_array_equal(step, target)


def test_what_has_its_goal_value_is_held_and_the_other_continues(problem):
    rng = np.random.default_rng(0)
    turned = np.concatenate([problem.goal[:4], problem.start[4:]])
    bent = np.concatenate([problem.start[:4], problem.goal[4:]])
    for _ in range(20):
        target = problem.sample(rng)
        steps = problem.steer(turned, target, problem.goal, 4, rng)
        assert np.all(steps[:, :4] == problem.goal[:4])
        assert np.all(np.abs(steps[:, 4:] - turned[4:]).max(axis=1) > 0.01)
        steps = problem.steer(bent, target, problem.goal, 4, rng)
        assert np.all(steps[:, 4:] == problem.goal[4:])
        assert np.all(np.abs(steps[:, :4] - bent[:4]).max(axis=1) > 0.01)


def test_the_checks_along_an_edge_are_no_further_apart_than_the_resolution(problem):
    assert RESOLUTION == 0.03
    for a, b in ((node(0.0, 0.0), node(0.5, 0.1)), (node(0.3, 0.0), node(0.4, 0.61))):
        nodes = problem.interpolate(a, b)
        np.testing.assert_array_equal(nodes[-1], b)
        every = np.concatenate([a[None], nodes])
        assert np.abs(np.diff(every[:, 4:], axis=0)).max() <= RESOLUTION + 1e-12
        turns = quaternion.angle_between(every[1:, :4], every[:-1, :4])
        assert turns.max() <= RESOLUTION + 1e-9
        np.testing.assert_allclose(turns, turns[0], atol=1e-9)
    # 0.5 rad of turn is the longer way: 17 checks of 29 mrad; 0.61 rad of bending: 21.
    assert len(problem.interpolate(node(0.0, 0.0), node(0.5, 0.1))) == 17
    assert len(nodes) == 21
    assert len(problem.interpolate(node(0.0, 0.0), node(0.0, 0.4), resolution=0.1)) == 4
    assert len(problem.interpolate(problem.start, problem.start)) == 1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_blend_turns_evenly_on_the_shorter_arc(problem, sign):
    far = node(1.2, 0.4) * np.concatenate([np.full(4, sign), np.ones(ROBOT.n)])
    share = np.array([0.0, 0.25, 0.5, 1.0])
    nodes = problem.blend(problem.start, far, share)
    np.testing.assert_allclose(nodes[:, 4:], START.joint_pos + 0.4 * share[:, None])
    turned = quaternion.angle_between(nodes[:, :4], problem.start[:4])
    np.testing.assert_allclose(turned, 1.2 * share, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(nodes[:, :4], axis=1), 1.0)


def test_the_root_follows_its_path_by_progress(problem):
    """Halfway in the metric is halfway on the 0.4 m of the path: 0.2 m ahead."""
    share = np.array([0.0, 0.5, 0.75, 1.0])
    placed = problem.configurations(problem.blend(problem.start, problem.goal, share))
    expected = [PATH[0], [0.2, 0.0, 0.3], PATH[1], PATH[2]]
    np.testing.assert_allclose(placed[:, :3], expected, atol=1e-6)
    np.testing.assert_allclose(placed[0, 3:], problem.start)


def test_samples_are_within_the_joints_ranges_and_around_the_arc(problem):
    rng = np.random.default_rng(0)
    samples = np.array([problem.sample(rng) for _ in range(500)])
    assert np.all((samples[:, 4:] >= problem.lower) & (samples[:, 4:] <= problem.upper))
    span = problem.upper - problem.lower
    assert np.all(np.ptp(samples[:, 4:], axis=0) > 0.95 * span)
    np.testing.assert_allclose(np.linalg.norm(samples[:, :4], axis=1), 1.0)
    middle = quaternion.slerp(problem.start[:4], problem.goal[:4], 0.5)
    away = quaternion.angle_between(samples[:, :4], middle)
    assert 0.5 < np.median(away) < 1.5  # 45 deg of arc to either side, and 0.6 rad of spread


def test_a_start_beyond_a_joint_limit_widens_the_space():
    beyond = START.joint_pos.copy()
    beyond[0] = ROBOT.upper[0] + 0.04
    start = replace(START, joint_pos=beyond)
    problem = PostureProblem(CollisionChecker(ROBOT, FLAT), METRIC, start, GOAL, PATH)
    assert problem.upper[0] == beyond[0]
    np.testing.assert_array_equal(problem.upper[1:], ROBOT.upper[1:])
    np.testing.assert_array_equal(problem.lower, ROBOT.lower)


def test_an_edge_fails_wherever_on_it_the_robot_collides(problem):
    rng, hidden, passed = np.random.default_rng(0), 0, 0
    for _ in range(40):
        a, b = problem.sample(rng), problem.sample(rng)
        on_it = problem.configurations(problem.interpolate(a, b))
        free = [problem.checker.is_free(posture) for posture in on_it]
        assert problem.fails(a, b) == (not all(free))
        hidden += free[0] and free[-1] and not all(free)
        passed += all(free)
    assert hidden
    assert passed


VECTORS = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


@settings(max_examples=50)
@given(origin=VECTORS, way=VECTORS, step=st.floats(0.1, 5.0), seed=st.integers(0, 9))
def test_the_first_step_is_straight_and_none_leads_beyond_its_length(origin, way, step, seed):
    steps = blossom(origin, way, step, 5, np.random.default_rng(seed)) - origin
    length = np.linalg.norm(way)
    reach = min(step, length)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), reach, atol=1e-9)
    if length > 1e-6:
        np.testing.assert_allclose(steps[0], way / length * reach, atol=1e-9)


BALL = make_capsule("ball", np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.5]), 0.2)


@pytest.fixture(scope="module")
def positions() -> PointProblem:
    scene = replace(FLAT_SCENE, obstacles=(BALL,))
    return PointProblem(scene, np.array([0.0, 0.0, 0.3]), np.array([0.3, 0.4, 0.3]))


@pytest.mark.parametrize(
    ("position", "fails"),
    [
        ([0.0, 0.0, 0.001], False),
        ([0.0, 0.0, 0.0], False),
        ([0.0, 0.0, -0.001], True),
        ([0.81, 0.0, 0.5], True),
        ([0.79, 0.0, 0.5], False),
    ],
)
def test_the_root_stays_above_the_ground_and_outside_obstacles(positions, position, fails):
    assert positions.fails(np.zeros(3), np.array(position)) == fails
