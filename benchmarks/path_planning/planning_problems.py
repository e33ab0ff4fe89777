"""Problems for path planners: two free postures in a scene, and a budget to join them.

With the checker, the only file of the planner's benchmarks that calls the planner.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning import path_planner, smoothing
from humanoid_getup.planning.path_planner import PathOptions
from humanoid_getup.planning.placement import GoalPlacement, find_way_out
from humanoid_getup.planning.posture_space import PointProblem, PostureProblem
from humanoid_getup.planning.rrt_blossom import SearchStatus, search
from humanoid_getup.simulation.world import World
from path_planning.limited_checker import (
    Budget,
    BudgetSpentError,
    LimitedChecker,
)
from robots import Posture
from robots.quaternion import Array

NodePath = list[Array]
"""Nodes (4 + n,) from start to goal; empty if none was found."""
Planner = Callable[[PostureProblem, int], NodePath]
"""Searches a path, with a seed, and ends at the latest with a `BudgetSpentError`."""


@dataclass(frozen=True, kw_only=True)
class PlannerAttempt:
    """What a planner made of a problem."""

    path: NodePath
    time: float
    """Processor time [s], which other programs do not lengthen."""
    checks: int
    """Postures checked for collisions."""
    length: float | None
    """Of the path, in the posture metric."""

    def record(self) -> dict[str, Any]:
        """Return the figures."""
        figures = {"time_s": self.time, "checks": self.checks, "length": self.length}
        return {"found": bool(self.path), **figures}


class ProblemMaker:
    """Poses problems in one world, and lets planners try them."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.checker = LimitedChecker(world.robot, world.scene)
        self._goals = GoalPlacement(world)

    def pose_nearest(
        self, start: Posture, goals: Iterable[Posture], rng: np.random.Generator
    ) -> PostureProblem | None:
        """Pose a problem with the first goal that has a place at the start or beside it, if any.

        A start far from any room to stand is first moved there as it lies, for every planner.

        Args:
            start: Lying posture in the scene.
            goals: Postures anywhere on level ground.
            rng: Of the search of the root's path.
        """
        self.checker.grant(None)
        way_out = find_way_out(self.world, self.checker, start, rng)
        start = start if way_out is None else way_out.end
        for goal in goals:
            placed = self._goals.place(goal, start)
            if placed is None:
                continue
            problem = self.pose_problem(start, placed, rng)
            if problem is not None:
                return problem
        return None

    def pose_problem(
        self, start: Posture, goal: Posture, rng: np.random.Generator
    ) -> PostureProblem | None:
        """Pose a problem between two postures in the scene.

        None if one of them is not free, or if there is no path for the root alone.
        """
        checker = self.checker
        checker.grant(None)
        checker.reset()
        if checker.allow(start) or checker.allow(goal):
            return None
        ends = start.position, goal.position
        root = search(PointProblem(checker.scene, *ends), *ends, rng)
        if root.status is not SearchStatus.SOLVED:
            return None
        metric = PostureMetric.of(self.world.robot)
        return PostureProblem(checker, metric, start, goal, np.array(root.path))

    def attempt(
        self, problem: PostureProblem, planner: Planner, seed: int, budget: Budget
    ) -> PlannerAttempt:
        """Let a planner try a problem of this maker; a path that collides counts as none."""
        self.checker.grant(budget)
        began = time.thread_time()
        try:
            path = planner(problem, seed)
        except BudgetSpentError:
            path = []
        took, checks = time.thread_time() - began, self.checker.spent
        self.checker.grant(None)
        if path and not is_free_path(problem, path):
            path = []
        length = smoothing.length(problem, path) if path else None
        return PlannerAttempt(path=path, time=took, checks=checks, length=length)


def search_refined(problem: PostureProblem, seed: int) -> NodePath:
    """Search under the strict constraints, then from loose to strict, until a path is found."""
    rng, options = np.random.default_rng(seed), PathOptions()
    while True:
        found = path_planner.find_path(problem, rng, options)
        if found.status is SearchStatus.SOLVED:
            return found.path


def search_strict(problem: PostureProblem, seed: int) -> NodePath:
    """Search under the strict constraints only, again and again, until a path is found."""
    rng, options = np.random.default_rng(seed), PathOptions()
    while True:
        for problem.stride in options.strides:
            found = search(problem, problem.start, problem.goal, rng, options.search)
            if found.status is SearchStatus.SOLVED:
                return found.path


OWN_PLANNERS: dict[str, Planner] = {"refined": search_refined, "strict": search_strict}
"""Planners of this package, by name."""


def is_free_path(problem: PostureProblem, path: NodePath) -> bool:
    """Return whether a path collides nowhere, at the resolution of the problem."""
    return problem.is_free(path[0]) and not any(problem.fails(a, b) for a, b in pairwise(path))


def draw_seed(*numbers: int) -> int:
    """Draw the seed of a planner from the numbers of its problem, 32 bits."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])
