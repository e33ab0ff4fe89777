"""Refinement from loose to strict: a path without obstacles, repaired while they grow back."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.planning.posture_space import PostureProblem
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchResult, SearchStatus, search
from robots.quaternion import Array

INCREMENT = 0.025  # of looseness [Lin12], section 4.2.3
SPACING = 0.3  # rad between the postures at which a path may be cut
MARGIN = 2  # postures cut off on either side of an illegal segment
MERGE = 3  # postures; illegal segments closer than this are replanned as one


def refine(
    problem: PostureProblem, rng: np.random.Generator, options: SearchOptions
) -> SearchResult:
    """Find a path by tightening the constraints step by step, [Lin12], section 4.2.3.

    Departure from the paper, which removes the ground and the obstacles at first: here the
    robot may pass through itself as well, so that tangled limbs are refined in the same way,
    and a segment is replanned for all joints, not for those of one limb.
    """
    path, nodes, left = [problem.start, problem.goal], 0, options.max_edges
    try:
        for level in np.arange(1.0 - INCREMENT, -0.5 * INCREMENT, -INCREMENT):
            problem.checker.loosen(max(float(level), 0.0))
            repaired = repair(problem, path, rng, replace(options, max_edges=left))
            path, nodes, left = repaired.path, nodes + repaired.nodes, left - repaired.edges
            if repaired.status is not SearchStatus.SOLVED:
                reason = f"{repaired.reason} at looseness {level:.3f}"
                return replace(repaired, reason=reason, nodes=nodes, edges=options.max_edges - left)
    finally:
        problem.checker.loosen(0.0)
    edges = options.max_edges - left
    return SearchResult(status=SearchStatus.SOLVED, nodes=nodes, edges=edges, path=path)


def repair(
    problem: PostureProblem, path: list[Array], rng: np.random.Generator, options: SearchOptions
) -> SearchResult:
    """Cut the illegal segments out of a path and plan new ones, [Lin12], section 4.2.4.

    A segment that cannot be replanned is cut wider, up to the whole path.
    """
    nodes, edges, margin = 0, 0, MARGIN
    path = _subdivide(problem, path)
    while segments := illegal_segments(problem, path, margin):
        first, last = segments[0]
        rest = replace(options, max_edges=options.max_edges - edges)
        found = search(problem, path[first], path[last], rng, rest)
        nodes, edges = nodes + found.nodes, edges + found.edges
        if found.status is SearchStatus.SOLVED:
            new = _subdivide(problem, found.path)
            path, margin = [*path[:first], *new, *path[last + 1 :]], MARGIN
        elif (first, last) == (0, len(path) - 1) or edges >= options.max_edges:
            return replace(found, nodes=nodes, edges=edges)
        else:
            margin *= 2
    return SearchResult(status=SearchStatus.SOLVED, nodes=nodes, edges=edges, path=path)


def illegal_segments(
    problem: PostureProblem, path: list[Array], margin: int
) -> list[tuple[int, int]]:
    """Find the segments of a path that collide, as first and last nodes, both legal."""
    illegal = np.array([problem.fails(a, b) for a, b in pairwise(path)])
    return merge(np.flatnonzero(illegal), margin, len(path))


def merge(illegal: NDArray[np.intp], margin: int, count: int) -> list[tuple[int, int]]:
    """Merge illegal edges (each from node k to k + 1) of ``count`` nodes to widened segments."""
    segments: list[tuple[int, int]] = []
    for edge in illegal:
        first, last = max(int(edge) - margin, 0), min(int(edge) + 1 + margin, count - 1)
        if segments and first - segments[-1][1] <= MERGE:
            segments[-1] = (segments[-1][0], last)
        else:
            segments.append((first, last))
    return segments


def _subdivide(problem: PostureProblem, path: list[Array]) -> list[Array]:
    nodes = [path[0]]
    for a, b in pairwise(path):
        nodes += list(problem.interpolate(a, b, SPACING))
    return nodes
