"""Shortcuts: shorten the wandering paths of the trees, an addition to [Lin12]."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from humanoid_getup.planning.posture_space import PostureProblem
from robots.quaternion import Array

GAIN = 0.01  # of the metric; a segment that would be shortened by less stays


def shorten(
    problem: PostureProblem, path: list[Array], rng: np.random.Generator, rounds: int
) -> list[Array]:
    """Replace segments of a path by straight ones where those are free.

    First the whole path is tried, then segments between pairs of points drawn from anywhere
    on it, one in each round; then every node is dropped whose neighbors can be joined. A
    shorter path is a faster rise.
    """
    if not problem.fails(path[0], path[-1]):
        return [path[0], path[-1]]
    for _ in range(rounds):
        way = _ways(problem, path)
        low, high = np.sort(rng.uniform(0.0, way[-1], size=2))
        (i, a), (j, b) = _cut(problem, path, way, low), _cut(problem, path, way, high)
        gain = high - low - float(problem.distance(a[None], b)[0])
        if i < j and gain > GAIN and not problem.fails(a, b):
            path = [*path[: i + 1], a, b, *path[j + 1 :]]
    return _drop_needless(problem, path)


def length(problem: PostureProblem, path: list[Array]) -> float:
    """Compute the length of a path in the metric."""
    return float(_ways(problem, path)[-1])


def _ways(problem: PostureProblem, path: list[Array]) -> Array:
    """Compute how far along the path its nodes lie, (K,)."""
    steps = [float(problem.distance(b[None], a)[0]) for a, b in pairwise(path)]
    return np.concatenate([[0.0], np.cumsum(steps)])


def _cut(problem: PostureProblem, path: list[Array], way: Array, at: float) -> tuple[int, Array]:
    """Find the edge and the point that lie ``at`` along the path."""
    edge = min(int(np.searchsorted(way, at, side="right")) - 1, len(path) - 2)
    share = (at - way[edge]) / max(way[edge + 1] - way[edge], 1e-12)
    return edge, problem.blend(path[edge], path[edge + 1], np.array([share]))[0]


def _drop_needless(problem: PostureProblem, path: list[Array]) -> list[Array]:
    kept = [path[0]]
    for k in range(1, len(path) - 1):
        if problem.fails(kept[-1], path[k + 1]):
            kept.append(path[k])
    return [*kept, path[-1]]
