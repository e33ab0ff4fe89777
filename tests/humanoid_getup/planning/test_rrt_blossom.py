"""RRT-blossom finds its way out of a trap in the plane, and says so when there is none."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from open_plane import STEP, OpenPlane

from humanoid_getup.planning.rrt_blossom import (
    ROOT,
    SearchOptions,
    SearchStatus,
    Tree,
    Viability,
    regresses,
    search,
)
from robots.quaternion import Array

# A box open to the left, with the goal behind its back: straight ahead is a dead end.
TRAP = [((0.0, 1.0), (1.0, 1.0)), ((1.0, 1.0), (1.0, -1.0)), ((1.0, -1.0), (0.0, -1.0))]
LID = [((0.0, 1.0), (0.0, -1.0))]


@dataclass
class Plane(OpenPlane):
    """Points in the plane between walls."""

    walls: list[tuple[tuple[float, float], tuple[float, float]]]

    def fails(self, a: Array, b: Array) -> bool:
        return bool(np.max(np.abs(b)) > 2.0) or any(crosses(a, b, wall) for wall in self.walls)


def crosses(a: Array, b: Array, wall) -> bool:
    c, d = np.array(wall[0]), np.array(wall[1])

    def side(p: Array, q: Array, r: Array) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) <= 0.0 and side(c, d, a) * side(c, d, b) <= 0.0


START, GOAL = np.array([0.5, 0.0]), np.array([1.6, 0.1])
OPTIONS = SearchOptions(max_edges=6000, controls=6, edges_per_node=6)


@pytest.mark.parametrize("seed", range(4))
def test_it_escapes_from_a_trap(seed: int):
    plane = Plane(TRAP)
    result = search(plane, START, GOAL, np.random.default_rng(seed), OPTIONS)
    assert result.status is SearchStatus.SOLVED
    np.testing.assert_array_equal(result.path[0], START)
    np.testing.assert_array_equal(result.path[-1], GOAL)
    assert len(result.path) > 10  # out of the box and around it
    for a, b in pairwise(result.path):
        assert plane.is_within_step(a, b)
        assert not plane.fails(a, b)


def test_there_is_no_way_out_of_a_closed_box():
    result = search(Plane(TRAP + LID), START, GOAL, np.random.default_rng(0), OPTIONS)
    assert result.status is SearchStatus.BUDGET_SPENT
    assert result.path == []


def test_a_start_walled_in_on_all_sides_is_found_dead_at_once():
    cell = [((x, -0.05), (x, 0.05)) for x in (0.45, 0.55)]
    cell += [((0.45, y), (0.55, y)) for y in (-0.05, 0.05)]
    result = search(Plane(cell), START, GOAL, np.random.default_rng(0), OPTIONS)
    assert result.status is SearchStatus.BUDGET_SPENT
    assert result.reason == "every edge around the start is dead"
    assert result.edges < 100


def test_the_same_seed_finds_the_same_path():
    paths = [search(Plane(TRAP), START, GOAL, np.random.default_rng(4)).path for _ in range(2)]
    np.testing.assert_array_equal(paths[0], paths[1])


def test_a_blossom_beside_the_way_to_the_sample_may_be_the_one_that_meets():
    # Straight ahead (down) the way is blocked; the blossom to the right lands within a step of
    # the goal, and one expansion is all that the budget allows.
    class Sideways(Plane):
        def steer(self, near, target, goal, count, rng):  # noqa: ARG002
            return near + STEP * np.array([[0.0, -1.0], [1.0, 0.0]])[:count]

        def sample(self, rng):  # noqa: ARG002
            return np.array([0.0, -2.0])

        def fails(self, a, b):  # noqa: ARG002
            return bool(b[1] < 0.0)

    goal = np.array([1.9 * STEP, 0.0])
    options = SearchOptions(max_edges=2, controls=2, edges_per_node=2)
    result = search(Sideways([]), np.zeros(2), goal, np.random.default_rng(0), options)
    assert result.status is SearchStatus.SOLVED
    np.testing.assert_allclose(result.path, [[0.0, 0.0], [STEP, 0.0], goal])


def test_regression_is_what_comparing_with_every_node_says():
    plane, rng = Plane([]), np.random.default_rng(0)
    tree = Tree(rng.normal(size=2), edges_per_node=10)
    for _ in range(30):
        tree.grow(ROOT, rng.normal(size=2))
    answers = []
    for _ in range(200):
        leaf, parent = rng.normal(size=2), int(rng.integers(len(tree)))
        closer = [
            np.linalg.norm(node - leaf) < np.linalg.norm(tree.nodes[parent] - leaf)
            for node in tree.nodes
        ]
        answers.append(any(closer))
        assert regresses(plane, tree, parent, leaf) == answers[-1]
    assert 0 < sum(answers) < 200


@dataclass
class Witness(Plane):
    """A plane that records every step offered: where from, and the leaves, in order."""

    def __post_init__(self) -> None:
        self.asked: list[tuple[Array, Array]] = []

    def steer(self, near, target, goal, count, rng):
        leaves = super().steer(near, target, goal, count, rng)
        self.asked.append((near, leaves))
        return leaves


def test_every_edge_that_is_tried_counts_once():
    plane = Witness(TRAP + LID)
    options = SearchOptions(max_edges=200, controls=1, edges_per_node=50)
    result = search(plane, START, GOAL, np.random.default_rng(0), options)
    assert result.edges == sum(len(leaves) for _, leaves in plane.asked) == 200
    assert result.reason == "200 edges tried, the budget is 200"
    assert result.nodes > 10


@pytest.mark.parametrize("seed", range(2))
def test_a_search_grows_no_node_that_is_closer_to_another_than_to_its_parent(seed: int):
    plane = Witness(TRAP + LID)  # start and goal trees cannot meet, or see each other
    options = SearchOptions(max_edges=300, controls=6, edges_per_node=6)
    search(plane, START, GOAL, np.random.default_rng(seed), options)
    inside = [(a, leaves) for a, leaves in plane.asked if 0.0 < a[0] < 1.0 and abs(a[1]) < 1.0]
    grown = 0
    for first, (origin, _) in enumerate(inside):
        earlier = [a for a, _ in inside[:first]]
        parents = [
            (k, a)
            for k, (a, leaves) in enumerate(inside[:first])
            if (leaves == origin).all(1).any()
        ]
        if not parents or any(np.array_equal(a, origin) for a in earlier):
            continue  # the root, or expanded before
        k, parent = parents[0]
        known = np.array([a for a, _ in inside[: k + 1]])  # in the tree when the node grew
        distance = np.linalg.norm(known - origin, axis=1)
        assert distance.min() >= np.linalg.norm(parent - origin) - 1e-12
        grown += 1
    assert grown > 10


def branch() -> tuple[Tree, list[int]]:
    """Grow root - 1 - 2 - 3 with two edges a node, the second of each dead."""
    tree = Tree(np.zeros(2), edges_per_node=2)
    nodes = [ROOT]
    for k in range(1, 4):
        nodes.append(tree.grow(nodes[-1], np.array([float(k), 0.0])))
        tree.mark_dead(nodes[-2])
    return tree, nodes


def test_death_recedes_to_the_root():
    tree, nodes = branch()
    tree.mark_dead(nodes[3])
    assert tree.state(nodes[3]) is Viability.LIVE  # one edge is untried
    tree.mark_dead(nodes[3])
    assert [tree.state(node) for node in nodes] == [Viability.DEAD] * 4
    assert not tree.is_viable


def test_one_dormant_edge_makes_a_branch_sleep_and_wakes_it_when_revived():
    tree, nodes = branch()
    tree.mark_dead(nodes[3])
    leaf = np.array([4.0, 0.0])
    tree.mark_dormant(nodes[3], leaf)
    assert [tree.state(node) for node in nodes] == [Viability.DORMANT] * 4
    assert not tree.candidates.any()
    assert tree.is_viable
    woken = tree.revive(0)
    assert [tree.state(node) for node in [*nodes, woken]] == [Viability.LIVE] * 5
    assert tree.candidates.tolist() == [False] * 4 + [True]
    assert len(tree.dormant_leaves) == 0
    tree.mark_dead(woken)
    tree.mark_dead(woken)
    assert [tree.state(node) for node in nodes] == [Viability.DEAD] * 4
