"""Shortcuts: a path gets no longer, keeps its ends, and stays free."""

from itertools import pairwise

import numpy as np
import pytest

from humanoid_getup.planning.shortcut import length, shorten
from robots.quaternion import Array

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
    """A detour of corners around the pillar."""
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


def test_a_free_way_is_straight(around):
    path = [around[0] + 5.0, *around[1:4], around[0] + np.array([9.0, 6.0])]
    made = shorten(RoundPillar(), path, np.random.default_rng(0), 40)  # type: ignore[arg-type]
    assert len(made) == 2
    assert made[0] is path[0] and made[1] is path[-1]
