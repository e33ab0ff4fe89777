"""Refinement on a plane: what is legal stays, what is not is replanned, within the budget."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from open_plane import STEP, OpenPlane

from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.posture_space import PostureProblem, to_node
from humanoid_getup.planning.refinement import (
    FINEST,
    MARGIN,
    WIDEST,
    PartialProblem,
    find_illegal,
    merge,
    refine,
    repair,
)
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchStatus
from humanoid_getup.scenes.scene import FLAT_SCENE
from robots import Posture, Robot, quaternion
from robots.quaternion import Array

SPACING = 0.1


class Plane(OpenPlane):
    """A wall at x = 0 bars |y| < ``height``."""

    def __init__(self, height: float) -> None:
        self.height = height

    def fails(self, a: Array, b: Array) -> bool:
        crosses = (a[0] < 0.0) != (b[0] < 0.0)
        return bool(np.max(np.abs(b)) > 2.0 or (crosses and abs(a[1] + b[1]) / 2 < self.height))

    def find_collisions(self, _a: Array, _b: Array) -> list:
        return []

    def interpolate(self, a: Array, b: Array, _spacing: float) -> Array:
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / SPACING - 1e-9)))
        return a + np.arange(1, count + 1)[:, None] / count * (b - a)


PATH = [np.array([-0.95, 0.0]), np.array([0.95, 0.0])]
OPTIONS = SearchOptions(max_edges=4000, controls=6, edges_per_node=6)


def run(height: float, options: SearchOptions = OPTIONS, seed: int = 0):
    problem = Plane(height)
    return problem, repair(problem, PATH, np.random.default_rng(seed), options)  # type: ignore[arg-type]


class Loosened(Plane):
    """A wall that grows from nothing to its height; it is its own checker."""

    def __init__(self, height: float) -> None:
        super().__init__(height)
        self.start, self.goal = PATH
        self.checker, self.whole = self, height
        self.levels: list[float] = []

    def loosen(self, looseness: float) -> None:
        self.levels.append(looseness)
        self.height = (1.0 - looseness) * self.whole


@pytest.mark.parametrize("seed", range(2))
def test_a_path_is_tightened_to_the_strict_one(seed: int):
    problem, rng = Loosened(0.6), np.random.default_rng(seed)
    found = refine(problem, rng, OPTIONS)  # type: ignore[arg-type]
    assert problem.levels == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.0, 0.0, 0.0], abs=1e-12)
    assert found.status is SearchStatus.SOLVED
    assert 0 < found.edges <= 4000 and found.nodes > 0
    assert not any(problem.fails(a, b) for a, b in pairwise(found.path))
    np.testing.assert_array_equal(found.path[0], PATH[0])
    np.testing.assert_array_equal(found.path[-1], PATH[-1])


def test_an_increment_is_doubled_after_a_repair_and_halved_after_a_failure():
    """A gap of 0.25 m beside a wall of 1.75 m: it is found only if the path is near it."""
    problem, rng, reached = Loosened(1.75), np.random.default_rng(0), list[float]()
    options = SearchOptions(max_edges=12000, controls=6, edges_per_node=1000)
    refine(problem, rng, options, report=reached.append)  # type: ignore[arg-type]
    increment, level, halved = WIDEST, 1.0, 0
    for tried in problem.levels[:-1]:
        assert tried == pytest.approx(max(level - increment, 0.0))
        if tried in reached:
            level, increment = tried, min(2.0 * increment, WIDEST)
        else:
            halved, increment = halved + 1, max(0.5 * increment, FINEST)
    assert halved
    assert len(reached) > 1


def test_a_path_that_cannot_be_tightened_says_how_loose_it_was():
    """The wall of 5 m reaches the edge of the plane, 2 m away, at a looseness of 0.6."""
    problem = Loosened(5.0)
    options = SearchOptions(max_edges=6000, controls=6, edges_per_node=1000)
    found = refine(problem, np.random.default_rng(0), options)  # type: ignore[arg-type]
    assert found.status is SearchStatus.BUDGET_SPENT
    assert " at looseness 0." in found.reason
    assert float(found.reason.split()[-1]) >= 0.575
    assert 6000 <= found.edges < 6012
    assert problem.height == 5.0, "it is strict again"


def test_a_legal_path_is_divided_and_nothing_else():
    _, found = run(0.0)
    assert (found.status, found.edges, found.nodes) == (SearchStatus.SOLVED, 0, 0)
    assert len(found.path) == 20
    np.testing.assert_allclose(np.diff(found.path, axis=0), [[0.1, 0.0]] * 19, atol=1e-12)


@pytest.mark.parametrize(("height", "seed"), [(0.2, 0), (0.2, 1), (0.8, 2)])
def test_a_wall_is_walked_around_and_the_ends_stay(height: float, seed: int):
    problem, found = run(height, seed=seed)
    assert found.status is SearchStatus.SOLVED
    assert found.edges > 0 and found.nodes > 0
    np.testing.assert_array_equal(found.path[0], PATH[0])
    np.testing.assert_array_equal(found.path[-1], PATH[-1])
    assert not any(problem.fails(a, b) for a, b in pairwise(found.path))
    assert max(abs(node[1]) for node in found.path) >= height - STEP
    if height == 0.2:  # only the wall's own stretch and its margin are new
        kept = 10 - MARGIN
        np.testing.assert_allclose([node[1] for node in found.path[:kept]], 0.0)
        np.testing.assert_allclose([node[1] for node in found.path[-kept:]], 0.0)


def test_a_stretch_is_the_illegal_edges_and_a_margin():
    problem = Plane(0.2)
    path = [np.array([-0.95 + 0.1 * k, 0.0]) for k in range(20)]
    # Edge 9 leads from -0.05 to 0.05.
    illegal = np.flatnonzero(find_illegal(problem, path))  # type: ignore[arg-type]
    assert merge(illegal, 2, len(path)) == [(7, 12)]
    assert merge(illegal, 0, len(path)) == [(9, 10)]
    assert merge(illegal, 50, len(path)) == [(0, 19)]
    assert merge(np.array([10, 14, 30, 35]), 0, 100) == [(10, 15), (30, 31), (35, 36)], (
        "three apart"
    )


@pytest.fixture(scope="module")
def arm_in_body(op3: Robot) -> tuple[PostureProblem, list[Array]]:
    """A robot in the air whose left arm would pass through it, as the right knee bends."""
    angles = op3.standing.joint_pos
    start = replace(op3.standing, position=np.array([0.0, 0.0, 1.0]), joint_pos=angles.copy())
    goal = replace(start, joint_pos=angles.copy())
    goal.joint_pos[op3.joint_names.index("r_knee")] -= 0.3
    way = np.tile(start.position, (2, 1))
    checker = CollisionChecker(op3, FLAT_SCENE)
    arm, rng = find_arm(op3), np.random.default_rng(0)
    for _ in range(300):
        for posture in (start, goal):
            posture.joint_pos[arm] = rng.uniform(op3.lower[arm], op3.upper[arm])
        problem = PostureProblem(checker, PostureMetric.of(op3), start, goal, way)
        path = [to_node(start), to_node(goal)]
        if all(map(problem.is_free, path)) and problem.fails(*path):
            return problem, path
    raise AssertionError("its arm never passes through it")


def find_arm(robot: Robot) -> list[int]:
    return [robot.joint_names.index(name) for name in ("l_sho_pitch", "l_sho_roll", "l_el")]


def test_where_only_an_arm_collides_only_the_arm_is_planned(op3: Robot, arm_in_body):
    problem, path = arm_in_body
    found = repair(problem, path, np.random.default_rng(0), SearchOptions(max_edges=4000))
    assert found.status is SearchStatus.SOLVED
    assert not any(problem.fails(a, b) for a, b in pairwise(found.path))
    np.testing.assert_array_equal([found.path[0], found.path[-1]], path)
    others = np.setdiff1d(np.arange(op3.n), find_arm(op3))
    moved = np.array(found.path)[:, 4 + others] - path[0][4 + others]
    whole = path[1][4 + others] - path[0][4 + others]
    share = moved @ whole / (whole @ whole)
    assert np.abs(moved - share[:, None] * whole).max() < 1e-9
    assert np.all(np.diff(share) >= -1e-9)


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
