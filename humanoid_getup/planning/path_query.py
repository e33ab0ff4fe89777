"""Path queries: goals, and the answer of the search for a path, without physics."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from humanoid_getup.experiments.falls import classify
from humanoid_getup.motions.motion import NO_END, Motion, Trajectory
from humanoid_getup.motions.motion_database import Connection, KeyPosture, MotionDatabase, name_body
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.path_planner import PathOptions, PathResult, place_stops, plan_via
from humanoid_getup.planning.placement import WayOut, find_way_out
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion

CONNECTIONS = 6  # as many as a planned rise tries
Progress = Callable[[str, float | None], None]
"""Called with the name of the goal, and the looseness at which there is a path to it, if any."""


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A goal of a path."""

    name: str
    posture: Posture
    connection: Connection | None = None
    """Frame of the motion that is joined there; ``None`` for a requested posture."""


@dataclass(frozen=True, kw_only=True)
class PathAnswer:
    """Answer to a path query; without a path, for the goal of the best attempt."""

    goal: Goal
    result: PathResult
    way_out: WayOut | None
    """Path of the root to a place with room to stand, which comes first."""
    tried: tuple[tuple[str, str], ...]
    """Each goal that was tried, and why there is no path to it; empty for the one with a path."""
    nodes: int
    """Nodes of all searches."""
    checks: int
    """Of all searches."""
    time: float
    """Wall time [s]."""

    @property
    def found(self) -> bool:
        """Return whether there is a path."""
        return self.result.trajectory is not None

    @property
    def path(self) -> Trajectory | None:
        """Return the path, or the free beginning of the best one; ``None`` if there is none."""
        return self.result.trajectory or self.result.beginning


def choose_goals(database: MotionDatabase, last: Posture) -> list[Goal]:
    """Choose frames at which stored motions may be joined, the nearest to a posture first."""
    return [
        Goal(name=c.motion.name, posture=c.posture, connection=c)
        for c in database.select(last, CONNECTIONS)
    ]


def find_path(
    world: World,
    start: Posture,
    keys: Sequence[KeyPosture],
    goals: Sequence[Goal],
    rng: np.random.Generator,
    options: PathOptions,
    report: Progress = lambda _goal, _looseness: None,
) -> PathAnswer:
    """Plan through the key postures to the first goal with a path.

    A start that is not valid has no path to any of them: the others are not tried. One far from
    any room to stand is first moved there as it lies. No servo robot can follow that: a rise crawls
    there instead, and takes no path from here.
    """
    began, checker = time.perf_counter(), CollisionChecker(world.robot, world.scene)
    way_out = find_way_out(world, checker, start, rng)
    before = start if way_out is None else way_out.end
    answers: list[tuple[Goal, PathResult]] = []
    for goal in goals:
        report(goal.name, None)
        stops = _place(world, before, keys, goal)
        if isinstance(stops, PathResult):
            result = stops
        else:
            tell = partial(report, goal.name)
            result = plan_via(start, stops, checker, rng, options, tell, way_out)
        answers.append((goal, result))
        if result.status in (SearchStatus.SOLVED, SearchStatus.START_INVALID):
            break
    metric = PostureMetric.of(world.robot)
    chosen = answers[-1]
    if chosen[1].trajectory is None:
        chosen = max(answers, key=lambda one: (one[1].leg, _measure(metric, one[1].beginning)))
    return PathAnswer(
        goal=chosen[0],
        result=chosen[1],
        way_out=way_out,
        tried=tuple((goal.name, result.reason) for goal, result in answers),
        nodes=sum(result.nodes for _, result in answers),
        checks=checker.checks,
        time=time.perf_counter() - began,
    )


def _place(
    world: World, start: Posture, keys: Sequence[KeyPosture], goal: Goal
) -> list[Posture] | PathResult:
    """Place key postures and goal, each at the one before; or return which one has no place."""
    placed = place_stops(world, [*(key.posture for key in keys), goal.posture], start)
    names = [*(key.name for key in keys), goal.name]
    stops = [stop for stop in placed if stop is not None]
    if len(stops) == len(placed):
        return stops
    leg = placed.index(None)
    reason = f"there is no place for {names[leg]} at the robot or beside it"
    return PathResult(status=SearchStatus.GOAL_INVALID, reason=reason, leg=leg + 1)


def measure_length(metric: PostureMetric, path: Trajectory) -> float:
    """Measure the length of a path in the posture metric, root and joints."""
    q, v = path.orientation, path.joint_pos
    turned = metric.root_weight * 0.5 * quaternion.angle_between(q[:-1], q[1:])
    bent = np.sqrt(np.sum(metric.joint_weight * np.diff(v, axis=0) ** 2, axis=1))
    return float(np.sum(turned + bent))


def _measure(metric: PostureMetric, path: Trajectory | None) -> float:
    return 0.0 if path is None else measure_length(metric, path)


def to_motion(world: World, path: Trajectory, answer: PathAnswer, seed: int) -> Motion:
    """Make a motion of a path: its targets are its angles, and its end is no stand."""
    joined = answer.goal.connection
    made: dict[str, str | float | int] = {
        "program": "getup plan",
        "goal": answer.goal.name,
        "scene": world.scene.name,
        "seed": seed,
        "complete": int(answer.found),
    }
    if joined is not None:
        made |= {"frame": joined.frame, "frame_time_s": float(joined.motion.time[joined.frame])}
    return Motion(
        name="path",
        robot=world.robot.name,
        start_class=classify(path.orientation[0])
        or (joined.motion.start_class if joined else "squat"),
        end_class=NO_END,
        strategy=f"path to {answer.goal.name}",
        time=path.time,
        position=path.position,
        orientation=quaternion.normalize(path.orientation),
        joint_pos=path.joint_pos,
        joint_target=path.joint_pos,
        provenance=made | name_body(world.robot),
    )
