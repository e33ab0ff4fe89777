"""Planners of OMPL on the problems of this package: same postures, same checks of edges."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from humanoid_getup.planning.posture_space import SMALL, SPREAD, PostureProblem
from path_planning.limited_checker import BudgetSpentError
from path_planning.planning_problems import NodePath, Planner
from robots import quaternion
from robots.quaternion import Array

# Longest edge, in the metric. Of 1, 2, 4 and OMPL's own, RRTConnect solves most with this one.
RANGE = 1.0
OFF_ARC = 2.0 * SPREAD  # rad, half the largest rotation off the arc, about each axis


class Space:
    """The space that OMPL searches for a problem.

    Its axes are the share of the arc from the start's orientation to the goal's, a rotation off
    that arc, as wide as this package samples it, and the joint angles. They are scaled by the
    weights of the posture metric, so distances are those of the metric but for the Pythagorean
    sum.
    """

    def __init__(self, problem: PostureProblem) -> None:
        self.problem = problem
        self.is_spent = False
        """Whether the budget was spent; nothing is free from then on."""
        start, goal, weight = problem.start[:4], problem.goal[:4], problem.root_weight
        self._arc = start, goal
        turn = 0.5 * float(quaternion.angle_between(start, goal))
        self.scale = np.array([max(weight * turn, SMALL), *[weight] * 3, *problem.scale])
        off = np.full(3, OFF_ARC)
        self.lower = self.scale * np.concatenate([[0.0], -off, problem.lower])
        self.upper = self.scale * np.concatenate([[1.0], off, problem.upper])

    def to_node(self, state: Any) -> Array:
        """Convert a state to a node (4 + n,)."""
        x = np.array([state[k] for k in range(len(self.scale))]) / self.scale
        arc = quaternion.slerp(*self._arc, float(x[0]))
        half = float(np.linalg.norm(x[1:4]))
        off = np.array([np.cos(half), *np.sinc(half / np.pi) * x[1:4]])
        return np.concatenate([quaternion.multiply(arc, off), x[4:]])

    def to_values(self, share: float, node: Array) -> list[float]:
        """Convert a node at an end of the arc to the values of a state."""
        return (self.scale * np.concatenate([[share], np.zeros(3), node[4:]])).tolist()

    def is_free(self, state: Any) -> bool:
        """Return whether a state collides with nothing."""
        return self._holds(lambda: self.problem.is_free(self.to_node(state)))

    def joins(self, a: Any, b: Any) -> bool:
        """Return whether the edge between two states is free, by the package's own function."""
        return self._holds(lambda: not self.problem.fails(self.to_node(a), self.to_node(b)))

    def _holds(self, test: Callable[[], bool]) -> bool:
        try:
            return not self.is_spent and test()
        except BudgetSpentError:  # must not pass through OMPL
            self.is_spent = True
            return False


class SameEdges(ob.MotionValidator):
    """Lets OMPL check its edges by the package's own function."""

    def __init__(self, info: ob.SpaceInformation, space: Space) -> None:
        super().__init__(info)
        self._space = space

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:
        """Return whether the edge from ``a`` to ``b`` is free."""
        return self._space.joins(a, b)


def search_rrt_connect(problem: PostureProblem, seed: int) -> NodePath:
    """Search with RRTConnect, [Kuffner00]: two trees, each connected to the other."""
    return _search(problem, seed, og.RRTConnect)


def search_kpiece(problem: PostureProblem, seed: int) -> NodePath:
    """Search with KPIECE1, [Sucan09]: one tree that grows at the border of what it covers."""
    return _search(problem, seed, og.KPIECE1)


OMPL_PLANNERS: dict[str, Planner] = {"RRTConnect": search_rrt_connect, "KPIECE1": search_kpiece}


def _search(
    problem: PostureProblem, seed: int, make: Callable[[ob.SpaceInformation], Any]
) -> NodePath:
    ou.setLogLevel(ou.LOG_NONE)
    ou.RNG.setSeed(max(seed, 1))  # of all generators made from here on
    ours = Space(problem)
    space = ob.RealVectorStateSpace(len(ours.scale))
    bounds = ob.RealVectorBounds(len(ours.scale))
    for axis, (low, high) in enumerate(zip(ours.lower.tolist(), ours.upper.tolist(), strict=True)):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    info = setup.getSpaceInformation()
    setup.setStateValidityChecker(ours.is_free)
    info.setMotionValidator(SameEdges(info, ours))
    ends: list[Any] = [space.allocState(), space.allocState()]
    for state, share, node in zip(ends, (0.0, 1.0), (problem.start, problem.goal), strict=True):
        for axis, value in enumerate(ours.to_values(share, node)):
            state[axis] = value
    setup.setStartAndGoalStates(*ends)
    planner = make(info)
    planner.setRange(RANGE)
    setup.setPlanner(planner)
    setup.solve(ob.PlannerTerminationCondition(lambda: ours.is_spent))
    if not setup.haveExactSolutionPath():
        return []
    return [ours.to_node(state) for state in setup.getSolutionPath().getStates()]
