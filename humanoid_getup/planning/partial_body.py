"""Partial-body planning: only the limbs that collide are planned, along a path of the rest."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.planning.blossom import blossom
from humanoid_getup.planning.posture_space import STEP_JOINTS, PostureProblem
from robots.quaternion import Array

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
