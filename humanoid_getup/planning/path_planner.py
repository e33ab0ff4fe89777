"""Path planner: search, refine, shorten and smooth, from a posture to one or through several."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.posture_space import PointProblem, PostureProblem
from humanoid_getup.planning.refinement import Report, refine, repair
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchResult, SearchStatus, search
from humanoid_getup.planning.smoothing import SpeedLimits, shorten, smooth_free
from robots import Posture
from robots.quaternion import Array

SPEED_SHARE = 0.75  # of the servos' no-load speed
REPAIRS = 3  # times that a path is checked twice as finely
GRAZE = 0.001  # looseness by which a curve may exceed tolerances: a fraction of a millimeter


@dataclass(frozen=True, kw_only=True)
class PathOptions:
    """Effort of the path planner."""

    search: SearchOptions = field(default_factory=SearchOptions)
    strides: tuple[float, ...] = (1.0, 0.5, 0.2)
    """Step size of each search, as a share of the full one, before the constraints are
    loosened. Small steps free crossed limbs, large ones are quick."""
    refines: bool = True
    """Whether to refine from loose to strict if these searches fail."""
    refine_edges: int = 8000
    """Edges that the refinement from loose to strict may try."""
    max_checks: int = 300_000
    """Postures that all searches together may check for collisions."""
    shortcuts: int = 40
    """Pairs of points between which a shortcut is tried."""


@dataclass(frozen=True, kw_only=True)
class PathResult:
    """Result of planning a path."""

    status: SearchStatus
    reason: str = ""
    """Why there is no path; empty when solved."""
    trajectory: Trajectory | None = None
    """Smooth motion from start to goal, at rest at both ends, sampled at the control period;
    None unless solved."""
    nodes: int = 0
    """Postures in the search trees."""
    refined: bool = False
    """Whether strict searches failed, so that it was refined from loose to strict."""
    beginning: Trajectory | None = None
    """How far the best path leads without a collision; None if solved, or if it leads nowhere."""
    leg: int = 1
    """Of a path through key postures: number of the leg that failed, or of all when solved."""
    arrivals: tuple[int, ...] = ()
    """Samples at which the rest at each key posture ends."""


def plan_path(
    start: Posture,
    goal: Posture,
    checker: CollisionChecker,
    rng: np.random.Generator,
    options: PathOptions | None = None,
    report: Report = lambda _: None,
) -> PathResult:
    """Plan a smooth trajectory between two postures, [Lin12], section 4.2 and 4.3.

    The same state of ``rng`` gives the same result. ``report`` is called with the looseness at
    which there is a path, from 1 to 0, if the constraints have to be loosened.
    """
    options = options or PathOptions()
    checker.reset()
    for posture, status in ((start, SearchStatus.START_INVALID), (goal, SearchStatus.GOAL_INVALID)):
        if problems := checker.allow(posture):
            return PathResult(status=status, reason=problems)
    # The root's position is planned first, [Lin12], section 4.2.1.
    ends = start.position, goal.position
    root = search(PointProblem(checker.scene, *ends), *ends, rng, options.search)
    if root.status is not SearchStatus.SOLVED:
        reason = f"no path for the root: {root.reason}"
        return PathResult(status=root.status, reason=reason, nodes=root.nodes)
    metric = PostureMetric.of(checker.robot)
    problem = PostureProblem(checker, metric, start, goal, np.array(root.path))
    found = find_path(problem, rng, options, report)
    if found.status is SearchStatus.SOLVED:
        return _finish(problem, found, rng, options)
    beginning = _cut_where_illegal(problem, found.path)
    begun = _finish(problem, replace(found, path=beginning), rng, options) if beginning else None
    return PathResult(
        status=found.status,
        reason=found.reason,
        nodes=found.nodes,
        refined=found.refined,
        beginning=begun and begun.trajectory,
    )


def find_path(
    problem: PostureProblem,
    rng: np.random.Generator,
    options: PathOptions,
    report: Report = lambda _: None,
) -> SearchResult:
    """Search under the strict constraints; if that fails, refine from loose to strict."""
    last = problem.checker.checks + options.max_checks
    limited = replace(options.search, is_over=lambda: problem.checker.checks >= last)
    nodes, found = 0, None
    for stride in options.strides:
        problem.stride = stride
        found = search(problem, problem.start, problem.goal, rng, limited)
        nodes += found.nodes
        if found.status is SearchStatus.SOLVED:
            return replace(found, nodes=nodes)
    problem.stride = 1.0
    if found is not None and not options.refines:
        return replace(found, nodes=nodes)
    limited = replace(limited, max_edges=options.refine_edges)
    found = refine(problem, rng, limited, report)
    return replace(found, nodes=nodes + found.nodes, refined=True)


def _cut_where_illegal(problem: PostureProblem, path: list[Array]) -> list[Array]:
    """Cut a path before its first collision; empty if nothing is left."""
    free = list(itertools.takewhile(lambda edge: not problem.fails(*edge), pairwise(path)))
    return [path[0], *(b for _, b in free)] if free else []


def _finish(
    problem: PostureProblem, found: SearchResult, rng: np.random.Generator, options: PathOptions
) -> PathResult:
    """Shorten and smooth a path; repair what collides between the postures checked so far."""
    robot = problem.checker.robot
    limits = SpeedLimits(joint_speed=SPEED_SHARE * robot.max_velocity, period=robot.control_period)
    path = shorten(problem, found.path, rng, options.shortcuts)
    times, nodes, colliding = _smooth(problem, path, limits)
    for _ in range(REPAIRS):
        if not colliding:
            break
        problem.resolution *= 0.5
        repaired = repair(problem, path, rng, options.search)
        path = shorten(problem, repaired.path, rng, options.shortcuts)
        times, nodes, colliding = _smooth(problem, path, limits)
    if colliding:
        return PathResult(
            status=SearchStatus.BUDGET_SPENT,
            reason=f"{colliding} samples of the smoothed path still collide",
            nodes=found.nodes,
            refined=found.refined,
        )
    configurations = problem.configurations(nodes)
    lift = np.array([problem.checker.lift(c) for c in configurations])
    trajectory = Trajectory(
        time=times,
        position=configurations[:, :3] + lift[:, None] * np.array([0.0, 0.0, 1.0]),
        orientation=nodes[:, :4],
        joint_pos=nodes[:, 4:],
    )
    return PathResult(
        status=SearchStatus.SOLVED, trajectory=trajectory, nodes=found.nodes, refined=found.refined
    )


def _smooth(
    problem: PostureProblem, path: list[Array], limits: SpeedLimits
) -> tuple[Array, Array, int]:
    problem.checker.loosen(GRAZE)
    try:
        return smooth_free(path, limits, problem.is_free)
    finally:
        problem.checker.loosen(0.0)
