"""Refinement from loose to strict: a path without obstacles, repaired while they grow back."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.planning.collision import Collision
from humanoid_getup.planning.posture_space import STEP_JOINTS, PostureProblem, blossom
from humanoid_getup.planning.rrt_blossom import (
    Problem,
    SearchOptions,
    SearchResult,
    SearchStatus,
    search,
)
from robots.quaternion import Array

WIDEST, FINEST = 0.2, 0.00625  # increments that adapt to how hard a path is to repair
LEVEL_EDGES = 800  # that may be tried before an increment is halved
SPACING = 0.3  # rad between the postures at which a path may be cut
FINE_SPACING = 0.06  # rad between postures of a segment in which only limbs were planned
MARGIN = 2  # postures cut off on either side of an illegal segment
MERGE = 3  # postures; illegal segments closer than this are replanned as one
PARTIAL_SHARE = 0.3  # of the edges left, that a search for some limbs alone may try
MOST_REPAIRS = 60  # segments replanned, at one level

Report = Callable[[float], None]
"""Called with the looseness at which a path is legal."""


def refine(
    problem: PostureProblem,
    rng: np.random.Generator,
    options: SearchOptions,
    report: Report = lambda _: None,
) -> SearchResult:
    """Find a path by tightening the constraints step by step, [Lin12], section 4.2.3.

    Departure from the paper, which removes the ground and the obstacles at first: here the
    robot may pass through itself as well, so that crossed limbs are refined in the same way. And
    steps differ: they grow after a repair, and are halved after one that failed.
    If it fails, the path of the result is the one at the tightest constraints that it reached.
    """
    path, nodes, left, level = [problem.start, problem.goal], 0, options.max_edges, 1.0
    increment = WIDEST
    try:
        while level > 0.0:
            tighter = max(level - increment, 0.0)
            problem.checker.loosen(tighter)
            is_last = increment <= FINEST
            edges = left if is_last else min(left, LEVEL_EDGES)
            repaired = repair(problem, path, rng, replace(options, max_edges=edges))
            nodes, left = nodes + repaired.nodes, left - repaired.edges
            if repaired.status is SearchStatus.SOLVED:
                path, level = repaired.path, tighter
                report(level)
                increment = min(2.0 * increment, WIDEST)
            elif is_last or left <= 0 or options.is_over():
                reason = f"{repaired.reason} at looseness {tighter:.3f}"
                spent = options.max_edges - left
                return replace(repaired, reason=reason, nodes=nodes, edges=spent, path=path)
            else:
                increment = max(0.5 * increment, FINEST)
    finally:
        problem.checker.loosen(0.0)
    edges = options.max_edges - left
    return SearchResult(status=SearchStatus.SOLVED, nodes=nodes, edges=edges, path=path)


def repair(
    problem: PostureProblem, path: list[Array], rng: np.random.Generator, options: SearchOptions
) -> SearchResult:
    """Cut the illegal segments out of a path and plan new ones, [Lin12], section 4.2.4.

    Where only limbs collide, those are planned first, along the path of the rest; then the whole
    body is. A segment that cannot be replanned is cut wider, up to the whole path.
    """
    return _Repair(problem, path, rng, options).run()


class _Repair:
    """A path that is being repaired under the present constraints."""

    def __init__(
        self,
        problem: PostureProblem,
        path: list[Array],
        rng: np.random.Generator,
        options: SearchOptions,
    ) -> None:
        self._problem, self._rng, self._options = problem, rng, options
        self._path = _subdivide(problem, path)
        self._is_illegal = find_illegal(problem, self._path)
        self._nodes = self._edges = 0

    def run(self) -> SearchResult:
        """Replan segment by segment until all are legal, or the budget is spent."""
        margin, repairs = MARGIN, 0
        while segments := merge(np.flatnonzero(self._is_illegal), margin, len(self._path)):
            first, last = segments[0]
            new = self._replan(first, last)
            repairs += 1
            is_whole = (first, last) == (0, len(self._path) - 1)
            if new:
                self._splice(first, last, new)
                margin = MARGIN
            elif self._is_over() or is_whole:
                return self._result(SearchStatus.BUDGET_SPENT)
            else:
                margin *= 2
            if repairs == MOST_REPAIRS:
                return self._result(SearchStatus.BUDGET_SPENT)
        return self._result(SearchStatus.SOLVED)

    def _replan(self, first: int, last: int) -> list[Array]:
        """Plan a segment again; empty if that fails."""
        new = self._replan_limbs(first, last)
        return new or self._search(self._problem, self._path[first], self._path[last], 1.0)

    def _replan_limbs(self, first: int, last: int) -> list[Array]:
        """Plan only the colliding limbs of a segment; empty if more of the body collides."""
        segment = self._path[first : last + 1]
        limbs = _find_limbs(self._problem, segment, self._is_illegal[first:last])
        if limbs is None:
            return []
        joints = np.concatenate([self._problem.checker.find_joints(limb) for limb in limbs])
        partial = PartialProblem(self._problem, segment, np.sort(joints))
        path = self._search(partial, partial.start, partial.goal, PARTIAL_SHARE)
        nodes = [
            node for a, b in pairwise(path) for node in partial.interpolate(a, b, FINE_SPACING)
        ]
        return [segment[0], *nodes[:-1], segment[-1]] if path else []

    def _search(self, problem: Problem, start: Array, goal: Array, share: float) -> list[Array]:
        left = self._options.max_edges - self._edges
        edges = max(1, round(share * left))
        found = search(problem, start, goal, self._rng, replace(self._options, max_edges=edges))
        self._nodes, self._edges = self._nodes + found.nodes, self._edges + found.edges
        return found.path

    def _splice(self, first: int, last: int, new: list[Array]) -> None:
        new = _subdivide(self._problem, new)
        self._path = [*self._path[:first], *new, *self._path[last + 1 :]]
        between = find_illegal(self._problem, new)
        self._is_illegal = np.concatenate(
            [self._is_illegal[:first], between, self._is_illegal[last:]]
        )

    def _is_over(self) -> bool:
        return self._edges >= self._options.max_edges or self._options.is_over()

    def _result(self, status: SearchStatus) -> SearchResult:
        reason = ""
        if status is not SearchStatus.SOLVED:
            reason = _explain(self._problem, self._path, self._is_illegal)
        return SearchResult(
            status=status, reason=reason, nodes=self._nodes, edges=self._edges, path=self._path
        )


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


def find_illegal(problem: PostureProblem, path: list[Array]) -> NDArray[np.bool_]:
    """Find the edges of a path that collide, (K - 1,)."""
    return np.array([problem.fails(a, b) for a, b in pairwise(path)], bool)


def _find_limbs(
    problem: PostureProblem, path: list[Array], is_illegal: NDArray[np.bool_]
) -> list[int] | None:
    """Find the limbs that collide along a path; ``None`` if torso or all limbs collide."""
    limbs = set[int]()
    for collision in _find_collisions(problem, path, is_illegal):
        checker = problem.checker
        hit = {checker.find_limb(geom) for geom in collision.geoms} - checker.fixed
        if not hit:
            return None
        limbs |= hit
    if not limbs or len(limbs) == problem.checker.limb_count:
        return None
    return sorted(limbs)


def _find_collisions(
    problem: PostureProblem, path: list[Array], is_illegal: NDArray[np.bool_]
) -> list[Collision]:
    """Find the collisions along the illegal edges of a path, in order."""
    found: list[Collision] = []
    for edge in np.flatnonzero(is_illegal):
        found += problem.find_collisions(path[edge], path[edge + 1])
    return found


def _explain(problem: PostureProblem, path: list[Array], is_illegal: NDArray[np.bool_]) -> str:
    """Describe the deepest collision and its place on a path."""
    where = np.flatnonzero(is_illegal)
    found = _find_collisions(problem, path, is_illegal)
    if not found:
        return "the budget is spent"
    deepest = max(found, key=lambda collision: collision.depth)
    low, high = where[0] / len(is_illegal), (where[-1] + 1) / len(is_illegal)
    return f"{deepest}, between {low:.0%} and {high:.0%} of the path"


def _subdivide(problem: PostureProblem, path: list[Array]) -> list[Array]:
    nodes = [path[0]]
    for a, b in pairwise(path):
        nodes += list(problem.interpolate(a, b, SPACING))
    return nodes


LEAST_LENGTH = 0.5  # of a path in the metric, if hardly anything else moves along it


class PartialProblem:
    """Search space of the progress along a path and the joint angles of some limbs.

    A node is the progress, 0 to 1, and the angles in a row, (1 + k,). Root and other joints are
    those of the path at that progress.
    """

    def __init__(
        self, problem: PostureProblem, path: list[Array], joints: NDArray[np.intp]
    ) -> None:
        """Prepare to plan ``joints``, indices in robot order, (k,), along a path (K nodes)."""
        self._problem, self._columns = problem, 4 + joints
        self._path = np.array(path)
        for a, b in pairwise(self._path):  # -q is the same orientation, on the shorter arc
            b[:4] *= math.copysign(1.0, float(a[:4] @ b[:4]))
        steps = [float(problem.distance(b[None], a)[0]) for a, b in pairwise(path)]
        way = np.concatenate([[0.0], np.cumsum(steps)])
        self._progress = way / way[-1] if way[-1] > 0.0 else np.linspace(0.0, 1.0, len(path))
        self._scale = np.concatenate([[max(way[-1], LEAST_LENGTH)], problem.scale[joints]])
        self._lower = np.concatenate([[0.0], problem.lower[joints]])
        self._upper = np.concatenate([[1.0], problem.upper[joints]])
        self._step = problem.stride * STEP_JOINTS
        self.start = np.concatenate([[0.0], self._path[0, self._columns]])
        self.goal = np.concatenate([[1.0], self._path[-1, self._columns]])

    def distance(self, nodes: Array, x: Array) -> Array:
        """Compute the distances of nodes (N, 1 + k) from a node (1 + k,), shape (N,)."""
        return np.linalg.norm((nodes - x) * self._scale, axis=1)

    def sample(self, rng: np.random.Generator) -> Array:
        """Draw a progress, and joint angles anywhere in their range."""
        return rng.uniform(self._lower, self._upper)

    def steer(
        self, near: Array, target: Array, _goal: Array, count: int, rng: np.random.Generator, /
    ) -> Array:
        """Step straight to the target, and around that direction."""
        way = (target - near) * self._scale
        steps = blossom(near * self._scale, way, self._step, count, rng) / self._scale
        if np.linalg.norm(way) <= self._step:
            steps[0] = target
        return np.clip(steps, self._lower, self._upper)

    def is_within_step(self, a: Array, b: Array) -> bool:
        """Return whether one step leads from ``a`` to ``b``."""
        return bool(self.distance(a[None], b)[0] <= self._step + 1e-9)

    def fails(self, a: Array, b: Array) -> bool:
        """Return whether the robot collides between ``a`` and ``b``."""
        nodes = self.interpolate(a, b, self._problem.resolution)
        configurations = self._problem.configurations(nodes[::-1])
        return any(not self._problem.checker.is_free(c) for c in configurations)

    def interpolate(self, a: Array, b: Array, resolution: float) -> Array:
        """Compute the postures from ``a``, left out, to ``b``, (K, 4 + n), evenly apart."""
        ends = self._assemble(np.stack([a, b]))
        moved = float(np.abs(ends[1] - ends[0]).max())
        along = abs(b[0] - a[0]) * len(self._path) * resolution  # no node is left out
        count = max(1, math.ceil(max(moved, along) / resolution))
        share = np.arange(1, count + 1)[:, None] / count
        return self._assemble(a + share * (b - a))

    def _assemble(self, x: Array) -> Array:
        """Put the limbs' angles into the path's postures, (K, 1 + k) to (K, 4 + n)."""
        leg = np.clip(np.searchsorted(self._progress, x[:, 0]), 1, len(self._path) - 1)
        before, after = self._progress[leg - 1], self._progress[leg]
        share = (x[:, 0] - before) / np.maximum(after - before, 1e-12)
        nodes = self._path[leg - 1] + share[:, None] * (self._path[leg] - self._path[leg - 1])
        nodes[:, :4] /= np.linalg.norm(nodes[:, :4], axis=1, keepdims=True)
        nodes[:, self._columns] = x[:, 1:]
        return nodes
