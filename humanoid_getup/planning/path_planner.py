"""From a lying posture to a connecting posture: search, refine, shorten, smooth."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.posture_metric import PostureMetric, align
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.posture_space import PositionProblem, PostureProblem
from humanoid_getup.planning.refinement import mend, refine
from humanoid_getup.planning.rrt_blossom import PlanStatus, SearchOptions, SearchResult, search
from humanoid_getup.planning.shortcut import shorten
from humanoid_getup.planning.smoothing import SpeedLimits, Trajectory, smooth_free
from robots import Posture, Robot
from robots.quaternion import Array

MENDS = 3  # times that a path is checked twice as finely
GRAZE = 0.001  # looseness, a fraction of a millimeter: what a curve may cut off a tolerance


@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """How hard to try, and how fast to move."""

    search: SearchOptions = field(default_factory=SearchOptions)
    strides: tuple[float, ...] = (1.0, 0.5, 0.2)
    """Share of the fixed steps to take in each search, with fresh trees, before the constraints
    are loosened. Small steps get tangled limbs free, large ones get ahead."""
    refine_edges: int = 8000
    """Edges that the refinement from loose to strict may try."""
    shortcuts: int = 40
    """Pairs of points between which a shorter way is tried."""
    speed: float = 0.75
    """Joint speed as a share of the servos' no-load speed."""
    turn_rate: float = 4.0
    """Most that the root may turn [rad/s]."""
    ease: float = 0.15
    """Time in which speed is gathered and given up [s]."""

    def pace(self, robot: Robot) -> SpeedLimits:
        """Return how fast the robot's joints may go."""
        return SpeedLimits(
            joint_speed=self.speed * robot.max_velocity,
            turn_rate=self.turn_rate,
            ease=self.ease,
            period=robot.control_period,
        )


@dataclass(frozen=True, kw_only=True)
class PlanResult:
    """How planning ended."""

    status: PlanStatus
    reason: str = ""
    """What stood in the way; empty when solved."""
    goal: Posture
    """The goal, turned and shifted over the ground to the start."""
    path: list[Posture] = field(default_factory=list)
    """Control postures from start to goal; empty unless solved."""
    trajectory: Trajectory | None = None
    """The smooth way along the path; none unless solved."""
    refined: bool = False
    """Whether the strict search failed and refinement from loose to strict solved it."""
    colliding: int = 0
    """Samples of the trajectory that collide in spite of all mending."""
    nodes: int = 0
    """Postures in the search trees."""
    checks: int = 0
    """Postures checked for collisions."""
    time_s: float = 0.0

    @property
    def planned(self) -> bool:
        """Return whether there is a path."""
        return self.status is PlanStatus.SOLVED


def plan_rise(
    start: Posture,
    connection: Connection,
    checker: CollisionChecker,
    rng: np.random.Generator,
    options: PlanOptions | None = None,
) -> PlanResult:
    """Plan from a lying posture to where a motion of the database takes over."""
    return plan_path(start, connection.posture, checker, rng, options)


def plan_path(
    start: Posture,
    goal: Posture,
    checker: CollisionChecker,
    rng: np.random.Generator,
    options: PlanOptions | None = None,
) -> PlanResult:
    """Plan a smooth trajectory between two postures, [Lin12], section 4.2 and 4.3.

    The goal is first turned and shifted over the ground to where the start is.

    Args:
        start: Where the robot is.
        goal: Where it shall come to, anywhere on the ground.
        checker: The scene; what start and goal touch is allowed from here on.
        rng: Draws everything random: the same generator state gives the same answer.
        options: How hard to try, and how fast to move.
    """
    began, checks = time.perf_counter(), checker.checks
    options = options or PlanOptions()
    goal = align(goal, start)
    answer = _plan(start, goal, checker, rng, options)
    return replace(answer, checks=checker.checks - checks, time_s=time.perf_counter() - began)


def _plan(
    start: Posture,
    goal: Posture,
    checker: CollisionChecker,
    rng: np.random.Generator,
    options: PlanOptions,
) -> PlanResult:
    checker.reset()
    for posture, status in ((start, PlanStatus.START_INVALID), (goal, PlanStatus.GOAL_INVALID)):
        if fault := checker.allow(posture):
            return PlanResult(status=status, reason=fault, goal=goal)
    place = _plan_position(checker, start.position, goal.position, rng, options.search)
    if place.status is not PlanStatus.SOLVED:
        reason = f"the root finds no way: {place.reason}"
        return PlanResult(status=place.status, reason=reason, goal=goal, nodes=place.nodes)
    metric = PostureMetric.of(checker.robot)
    problem = PostureProblem(checker, metric, start, goal, np.array(place.path))
    found, refined = find_path(problem, rng, options)
    if found.status is PlanStatus.SOLVED:
        return _finish(problem, found, refined, goal, rng, options)
    return PlanResult(status=found.status, reason=found.reason, goal=goal, nodes=found.nodes)


def _plan_position(
    checker: CollisionChecker,
    start: Array,
    goal: Array,
    rng: np.random.Generator,
    options: SearchOptions,
) -> SearchResult:
    """Plan the root's position first, where it differs, [Lin12], section 4.2.1."""
    return search(PositionProblem(checker.scene, start, goal), start, goal, rng, options)


def find_path(
    problem: PostureProblem, rng: np.random.Generator, options: PlanOptions
) -> tuple[SearchResult, bool]:
    """Search under the strict constraints; if that fails, refine from loose to strict."""
    nodes = 0
    for problem.stride in options.strides:
        found = search(problem, problem.start, problem.goal, rng, options.search)
        nodes += found.nodes
        if found.status is PlanStatus.SOLVED:
            return replace(found, nodes=nodes), False
    problem.stride = 1.0
    found = refine(problem, rng, replace(options.search, max_edges=options.refine_edges))
    return replace(found, nodes=nodes + found.nodes), True


def _finish(
    problem: PostureProblem,
    found: SearchResult,
    refined: bool,
    goal: Posture,
    rng: np.random.Generator,
    options: PlanOptions,
) -> PlanResult:
    """Shorten and smooth a path; mend what collides between the postures checked so far."""
    pace = options.pace(problem.checker.robot)
    path = shorten(problem, found.path, rng, options.shortcuts)
    times, nodes, colliding = _smooth(problem, path, pace)
    for _ in range(MENDS):
        if not colliding:
            break
        problem.resolution *= 0.5
        mended = mend(problem, path, rng, options.search)
        path = shorten(problem, mended.path or path, rng, options.shortcuts)
        times, nodes, colliding = _smooth(problem, path, pace)
    if colliding:
        return PlanResult(
            status=PlanStatus.BUDGET_SPENT,
            reason=f"{colliding} samples of the smoothed path still collide",
            goal=goal,
            nodes=found.nodes,
            colliding=colliding,
        )
    configurations = problem.configurations(nodes)
    lift = np.array([problem.checker.lift(c) for c in configurations])
    trajectory = Trajectory(
        time=times,
        position=configurations[:, :3] + lift[:, None] * np.array([0.0, 0.0, 1.0]),
        orientation=nodes[:, :4],
        joint_pos=nodes[:, 4:],
    )
    return PlanResult(
        status=PlanStatus.SOLVED,
        goal=goal,
        path=[problem.posture(node) for node in path],
        trajectory=trajectory,
        refined=refined,
        nodes=found.nodes,
    )


def _smooth(
    problem: PostureProblem, path: list[Array], pace: SpeedLimits
) -> tuple[Array, Array, int]:
    problem.checker.loosen(GRAZE)
    try:
        return smooth_free(path, pace, problem.is_free)
    finally:
        problem.checker.loosen(0.0)
