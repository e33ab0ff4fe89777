"""The space of some limbs along a path of the rest: the path itself is in it, and its ends."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.partial_body import LEAST_LENGTH, PartialProblem
from humanoid_getup.planning.posture_space import PostureProblem, to_node
from humanoid_getup.scenes.scene import FLAT_SCENE
from robots import Posture, Robot, quaternion

JOINTS = np.array([1, 3])
SIDEWAYS = np.array([1.0, 0.0, 0.0])


def turned(posture: Posture, angle: float, bend: float) -> Posture:
    return replace(
        posture,
        orientation=quaternion.from_axis_angle(SIDEWAYS, angle),
        joint_pos=posture.joint_pos + bend,
    )


@pytest.fixture(scope="module")
def start(op3: Robot) -> Posture:
    return replace(op3.standing, position=np.array([0.0, 0.0, 1.0]))  # it touches nothing


@pytest.fixture(scope="module")
def whole(op3: Robot, start: Posture) -> PostureProblem:
    goal, way = turned(start, 0.9, 0.1), np.tile(start.position, (2, 1))
    checker = CollisionChecker(op3, FLAT_SCENE)
    return PostureProblem(checker, PostureMetric.of(op3), start, goal, way)


@pytest.fixture
def path(start: Posture) -> list[np.ndarray]:
    """Nodes that are not evenly apart; of the last, the quaternion has the other sign."""
    nodes = [to_node(turned(start, angle, angle / 9.0)) for angle in (0.0, 0.1, 0.5, 0.9)]
    nodes[-1][:4] *= -1.0
    return nodes


@pytest.fixture
def part(whole: PostureProblem, path: list[np.ndarray]) -> PartialProblem:
    return PartialProblem(whole, path, JOINTS)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return by how much two postures differ, whichever sign their quaternions have."""
    half = np.arccos(min(abs(float(one[:4] @ other[:4])), 1.0))
    return max(half, float(np.abs(one[4:] - other[4:]).max()))


def test_a_straight_way_of_limbs_that_go_with_the_path_is_the_path(
    part: PartialProblem, path: list[np.ndarray]
):
    """Joints bend here as the torso turns, so that every node of the path is on that way."""
    between = part.interpolate(part.start, part.goal, 0.001)
    assert apart(between[-1], path[-1]) < 1e-9
    assert max(apart(a, b) for a, b in pairwise([path[0], *between])) < 0.003
    for node in (path[1], path[2]):
        assert min(apart(node, other) for other in between) < 0.003
    np.testing.assert_allclose(np.linalg.norm(between[:, :4], axis=1), 1.0)


def test_only_the_chosen_limbs_leave_the_path(part: PartialProblem, path: list[np.ndarray]):
    moved = part.goal + np.array([0.0, 0.3, -0.4])
    end = part.interpolate(part.goal, moved, 0.01)[-1]
    expected = path[-1].copy()
    expected[4 + JOINTS] += [0.3, -0.4]
    assert apart(end, expected) < 1e-9


def test_no_two_postures_between_are_further_apart_than_the_resolution(part: PartialProblem):
    far = part.start + np.array([1.0, 0.7, 0.0])
    for resolution in (0.02, 0.1):
        between = part.interpolate(part.start, far, resolution)
        steps = np.abs(np.diff(between[:, 4 + JOINTS], axis=0))
        assert steps.max() <= resolution + 1e-9
        assert len(between) >= 0.7 / resolution


def test_its_distance_is_that_of_path_and_limbs(
    part: PartialProblem, whole: PostureProblem, path: list[np.ndarray]
):
    """By hand: the length of the path in the metric, and each joint by its weight."""
    length = sum(float(whole.distance(b[None], a)[0]) for a, b in pairwise(path))
    assert length > LEAST_LENGTH
    away = np.array([0.25, 0.0, 0.0])
    assert part.distance((part.start + away)[None], part.start)[0] == pytest.approx(0.25 * length)
    bent = part.start + np.array([0.0, 0.3, -0.4])
    expected = np.linalg.norm(np.array([0.3, -0.4]) * whole.scale[JOINTS])
    for a, b in ((bent, part.start), (part.start, bent)):
        assert part.distance(a[None], b)[0] == pytest.approx(expected)


def test_steps_stay_in_the_ranges_and_reach_what_is_near(part: PartialProblem, op3: Robot):
    rng = np.random.default_rng(0)
    for _ in range(20):
        near, target = part.sample(rng), part.sample(rng)
        steps = part.steer(near, target, part.goal, 8, rng)
        assert steps.shape == (8, 3)
        for node in (near, *steps):
            assert 0.0 <= node[0] <= 1.0
            assert np.all(node[1:] >= op3.lower[JOINTS] - 1e-9)
            assert np.all(node[1:] <= op3.upper[JOINTS] + 1e-9)
        # The first goes straight, and it comes nearer.
        if not part.is_within_step(near, target):
            assert part.is_within_step(near, steps[0])
            ahead = part.distance(np.stack([near, steps[0]]), target)
            assert ahead[1] < ahead[0]
        close = near + 0.01 * (target - near)
        np.testing.assert_array_equal(part.steer(near, close, part.goal, 3, rng)[0], close)


def test_an_edge_fails_if_any_posture_on_it_does(part: PartialProblem, whole: PostureProblem):
    """In the air only a limb in the robot can fail; here the left arm goes anywhere."""
    rng, found = np.random.default_rng(3), []
    for _ in range(12):
        a, b = part.sample(rng), part.sample(rng)
        on_it = whole.configurations(part.interpolate(a, b, whole.resolution))
        found.append(part.fails(a, b))
        assert found[-1] == any(not whole.checker.is_free(posture) for posture in on_it)
    assert set(found) == {True, False}
