"""Key path: a smooth path through several postures, each leg planned by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.path_planner import PathOptions, PathResult, plan_path
from humanoid_getup.planning.placement import SUNK, GoalPlacement, WayOut
from humanoid_getup.planning.refinement import Report
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place

# A position servo without load approaches its target with a time constant of its torque-speed
# slope over its gain, 0.045 s on OP3: after 0.3 s, 0.1 % of the distance is left, the rest is load.
KEY_REST = 0.3  # s for which a path rests at a key posture
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
        checker.allow(start)  # its contacts; whether it is valid is known
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
            course = course.rest(KEY_REST, period)
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
