"""Path planner: search, refine, shorten and smooth, from a posture to one or through several."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.placement import SUNK, GoalPlacement, WayOut
from humanoid_getup.planning.posture_space import PointProblem, PostureProblem
from humanoid_getup.planning.refinement import Report, refine, repair
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchResult, SearchStatus, search
from humanoid_getup.planning.smoothing import SpeedLimits, shorten, smooth_free
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

SPEED_SHARE = 0.75  # of the servos' no-load speed
REPAIRS = 3  # times that a path is checked twice as finely
GRAZE = 0.001  # looseness, a fraction of a millimeter: by which a curve may exceed a tolerance


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
    partial = _finish(problem, replace(found, path=beginning), rng, options) if beginning else None
    return PathResult(
        status=found.status,
        reason=found.reason,
        nodes=found.nodes,
        refined=found.refined,
        beginning=partial and partial.trajectory,
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
    for problem.stride in options.strides:
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


# A position servo without load approaches its target with a time constant of its torque-speed
# slope over its gain, 0.045 s on OP3: after 0.3 s, 0.1 % of the distance is left, the rest is load.
REST = 0.3  # s for which a path rests at a key posture
FLOATING = 0.003  # m over the ground, or in it, beyond which a posture does not rest there
SAME_JOINTS = 1e-6  # rad; a goal that is no farther needs no path


def place_stops(world: World, stops: Sequence[Posture], start: Posture) -> list[Posture | None]:
    """Put each posture at or beside the one before; ``None`` if there is no place.

    One that floats or is sunk, as those of users may, is put on what is under it.
    """
    goals, clearance = GoalPlacement(world), Clearance(world)
    root = world.robot.layout(world.model).root_position
    placed: list[Posture | None] = []
    for stop in stops:
        goal = goals.place(stop, start)
        if goal is not None:
            rested = clearance.rest_where(place(world.robot, world.model, goal), -SUNK)[root]
            if abs(rested[2] - goal.position[2]) > FLOATING:
                goal = replace(goal, position=rested.copy())
            start = goal
        placed.append(goal)
    return placed


def plan_via(
    start: Posture,
    stops: Sequence[Posture],
    checker: CollisionChecker,
    rng: np.random.Generator,
    options: PathOptions | None = None,
    report: Report = lambda _: None,
    way_out: WayOut | None = None,
) -> PathResult:
    """Plan a smooth trajectory from a start through all stops, of which the last is the goal.

    Every leg is planned by `plan_path`; a key posture given by the user may be far from any in the
    database, [Lin12], section 5.1. The trajectory rests at each stop but the last. A way out from
    the start is followed first.
    """
    plan = partial(plan_path, checker=checker, rng=rng, options=options, report=report)
    period = checker.robot.control_period
    course, legs, arrivals = Course.at(start), list[PathResult](), list[int]()
    if way_out is not None:
        checker.reset()
        checker.allow(start)
        course, start = Course.of(way_out.sample(checker)), way_out.end
    for goal in stops:
        if not _is_same(start, goal):
            legs.append(plan(start, goal))
            further = legs[-1].trajectory or legs[-1].beginning
            course = course if further is None else course.then(Course.of(further)[1:])
            if legs[-1].trajectory is None:
                return _sum_up(legs, course.to_trajectory(period), arrivals, len(arrivals) + 1)
        start = goal
        if len(arrivals) < len(stops) - 1:
            course = course.rest(REST, period)
            arrivals.append(len(course) - 1)
    return _sum_up(legs, course.to_trajectory(period), arrivals, len(stops))


def _sum_up(legs: list[PathResult], path: Trajectory, arrivals: list[int], leg: int) -> PathResult:
    last = legs[-1] if legs else PathResult(status=SearchStatus.SOLVED)
    is_solved = last.status is SearchStatus.SOLVED
    return replace(
        last,
        leg=leg,
        trajectory=path if is_solved else None,
        arrivals=tuple(arrivals),
        nodes=sum(one.nodes for one in legs),
        refined=any(one.refined for one in legs),
        beginning=path if not is_solved and len(path.time) > 1 else None,
    )


def _is_same(a: Posture, b: Posture) -> bool:
    """Return whether two postures are the same, except for sinking into the ground."""
    turned = 1.0 - abs(float(a.orientation @ b.orientation))
    return bool(np.abs(a.joint_pos - b.joint_pos).max() < SAME_JOINTS and turned < SAME_JOINTS)
