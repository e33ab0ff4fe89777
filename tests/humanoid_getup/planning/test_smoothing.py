"""Curves begin and end where the path does, never kink, and never go too fast."""

from itertools import pairwise

import numpy as np
import pytest

from humanoid_getup.planning.smoothing import (
    SpeedLimits,
    length,
    retime,
    shorten,
    smooth,
    smooth_free,
)
from robots import quaternion
from robots.quaternion import Array

N = 6
SPEED = np.linspace(1.0, 3.0, N)
PACE = SpeedLimits(joint_speed=SPEED, turn_rate=2.0, ease=0.15, period=0.008)


def zigzag(seed: int, nodes: int = 6) -> list[Array]:
    rng = np.random.default_rng(seed)
    q = quaternion.normalize(rng.normal(size=(nodes, 4)))
    return list(np.hstack([q, rng.uniform(-1.5, 1.5, size=(nodes, N))]))


@pytest.mark.parametrize(("seed", "roundness"), [(0, 0.0), (1, 0.3), (2, 1.0)])
def test_the_ends_are_exact(seed: int, roundness: float):
    path = zigzag(seed)
    time, nodes, _ = retime(smooth(path, np.full(len(path), roundness)), PACE)
    for node, end in ((nodes[0], path[0]), (nodes[-1], path[-1])):
        np.testing.assert_allclose(node[4:], end[4:], atol=1e-12)
        assert quaternion.angle_between(node[:4], end[:4]) < 1e-7
    np.testing.assert_allclose(np.diff(time), PACE.period, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_no_joint_and_no_root_is_ever_faster_than_allowed(seed: int):
    path = zigzag(seed)
    time, nodes, _ = retime(smooth(path, np.ones(len(path))), PACE)
    speed = np.abs(np.diff(nodes[:, 4:], axis=0)) / PACE.period / SPEED
    turn = quaternion.angle_between(nodes[1:, :4], nodes[:-1, :4]) / PACE.period / PACE.turn_rate
    share = np.maximum(speed.max(axis=1), turn)
    assert share.max() <= 1.0 + 1e-6
    # In between it is at the limit all the time; at both ends it is at rest.
    middle = (time[:-1] > PACE.ease) & (time[1:] < time[-1] - PACE.ease)
    assert share[middle].min() > 0.97
    assert share[[0, -1]].max() < 0.02


def test_a_corner_is_worked_out_by_hand():
    # Path 0 -> 1 -> 1 in one joint, 0 -> 0 -> 1 in another; fully rounded, the arc runs
    # from (.5, 0) to (1, .5) with control points (5/6, 0) and (1, 1/6); its middle is
    # (.5 + 3 * 5/6 + 3 + 1) / 8 = 0.875 and (0 + 0 + 3/6 + .5) / 8 = 0.125.
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    path = list(np.hstack([np.tile(quaternion.IDENTITY, (3, 1)), corners]))
    curve = smooth(path, np.ones(3))
    arc = curve.nodes[curve.corner == 1, 4:]
    np.testing.assert_allclose(arc[len(arc) // 2 - 1], [0.875, 0.125], atol=1e-12)


def test_a_corner_that_must_not_be_cut_is_not_cut():
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0]])
    path = list(np.hstack([np.tile(quaternion.IDENTITY, (4, 1)), corners]))
    pace = SpeedLimits(joint_speed=np.ones(2), period=0.008)

    def is_free(node: Array) -> bool:
        return not (node[4] < 1.0 - 1e-9 and node[5] > 0.01)  # a wall inside the first corner

    assert not all(is_free(node) for node in retime(smooth(path, np.ones(4)), pace)[1])
    _, nodes, colliding = smooth_free(path, pace, is_free)
    assert colliding == 0
    assert all(is_free(node) for node in nodes)
    assert np.linalg.norm(nodes[:, 4:] - corners[2], axis=1).min() > 0.05  # still rounded
    _, _, colliding = smooth_free(path, pace, lambda node: node[4] < 1.9)
    assert colliding > 0


RADIUS = 1.0


class RoundPillar:
    """A plane with a round pillar at its origin; what `shorten` asks of a problem."""

    def distance(self, nodes: Array, x: Array) -> Array:
        return np.linalg.norm(nodes - x, axis=1)

    def blend(self, a: Array, b: Array, share: Array) -> Array:
        return a + share[:, None] * (b - a)

    def fails(self, a: Array, b: Array) -> bool:
        between = self.blend(a, b, np.linspace(0.0, 1.0, 100))
        return bool(np.any(np.linalg.norm(between, axis=1) < RADIUS))


@pytest.fixture
def around() -> list[Array]:
    return [np.array(p) for p in ([-2.0, 0.0], [-2.0, 3.0], [0.0, 4.0], [2.0, 3.0], [2.0, 0.0])]


@pytest.mark.parametrize("seed", range(5))
def test_a_detour_gets_shorter_around_what_is_in_the_way(around, seed):
    problem = RoundPillar()
    path = shorten(problem, around, np.random.default_rng(seed), 40)  # type: ignore[arg-type]
    assert path[0] is around[0] and path[-1] is around[-1]
    assert not any(problem.fails(a, b) for a, b in pairwise(path))
    # The shortest way is two tangents of the pillar and the arc between them.
    shortest = 2.0 * np.sqrt(3.0) + np.pi / 3.0
    assert shortest <= length(problem, path) < 0.75 * length(problem, around)  # type: ignore[arg-type]
