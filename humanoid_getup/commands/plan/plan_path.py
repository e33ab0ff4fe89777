"""`getup plan`: a path without physics, to a stored motion or to any posture."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from tyro.conf import arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, NO_PATH
from humanoid_getup.commands.files import READ, Written, staging
from humanoid_getup.commands.inputs import find_start, load_keys, load_world
from humanoid_getup.commands.options import NO_ORIGIN, Keys, LoadOption, Origin, SceneOptions
from humanoid_getup.experiments.falls import Fall, classify
from humanoid_getup.motions.motion import NO_END, Motion, Trajectory
from humanoid_getup.motions.motion_database import (
    Connection,
    KeyPosture,
    MotionDatabase,
    load_database,
    name_body,
)
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.key_path import place_stops, plan_via
from humanoid_getup.planning.path_planner import PathOptions, PathResult
from humanoid_getup.planning.placement import WayOut, find_way_out
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.film_strip import NoRendererError, draw_motion
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.storage.validation import at_least

CONNECTIONS = 6  # as many as a planned rise tries
PATH, STRIP = "path.npz", "strip.png"
FILES = (PATH, STRIP)


@dataclass(frozen=True, kw_only=True)
class PlanRequest(LoadOption, SceneOptions):
    """Plan a path from a lying posture to a stored motion, or to any posture; no physics."""

    origin: Origin = None
    key: Keys = ()
    to: Annotated[str | None, READ, arg(metavar="FILE|motions:NAME@TIME")] = None
    """Where the path ends: a posture file, or a frame of a motion by its time [s]; default: the
    nearest postures at which stored motions are joined, in turn."""
    max_checks: Annotated[int, at_least(1, at_most=10**9)] = 300_000
    """Postures that may be checked for collisions, for each path between two postures."""
    refinement: bool = True
    """If there is no path, loosen the constraints and tighten them step by step."""
    out: Annotated[Path | None, Written(FILES), arg(metavar="DIR")] = None
    """Folder for path.npz and strip.png."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.origin:
            yield NO_ORIGIN


@dataclass(frozen=True, kw_only=True, eq=False)
class Goal(KeyPosture):
    """A goal of a path."""

    connection: Connection | None = None
    """Frame of the motion that is joined there; ``None`` for a requested posture."""


@dataclass(frozen=True, kw_only=True)
class PathAnswer(PathResult):
    """Answer to a path query; without a path, for the goal of the best attempt.

    Its nodes are those of all searches.
    """

    goal: Goal
    way_out: WayOut | None
    """Path of the root to a place with room to stand, which comes first."""
    tried: tuple[tuple[str, str], ...]
    """Each goal that was tried, and why there is no path to it; empty for the one with a path."""
    checks: int
    """Of all searches."""
    time: float
    """Wall time [s]."""

    @property
    def found(self) -> bool:
        """Return whether there is a path."""
        return self.trajectory is not None


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
    monitor: ProgressMonitor,
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
        monitor.begin(f"planning to {goal.name}")
        stops = _place(world, before, keys, goal)
        if isinstance(stops, PathResult):
            result = stops
        else:
            tell = partial(_show_tightened, monitor, goal.name)
            result = plan_via(start, stops, checker, rng, options, tell, way_out)
        answers.append((goal, result))
        if result.status in (SearchStatus.SOLVED, SearchStatus.START_INVALID):
            break
    metric, chosen = PostureMetric.of(world.robot), answers[-1]
    if chosen[1].trajectory is None:
        chosen = max(
            answers, key=lambda one: (one[1].leg, measure_length(metric, one[1].beginning))
        )
    goal, result = chosen
    result = replace(result, nodes=sum(each.nodes for _, each in answers))
    return PathAnswer(
        **vars(result),
        goal=goal,
        way_out=way_out,
        tried=tuple((one.name, each.reason) for one, each in answers),
        checks=checker.checks,
        time=time.perf_counter() - began,
    )


def _show_tightened(monitor: ProgressMonitor, goal: str, looseness: float) -> None:
    monitor.begin(f"planning to {goal}, constraints tightened to {1 - looseness:.0%}")


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


def measure_length(metric: PostureMetric, path: Trajectory | None) -> float:
    """Measure the length of a path in the posture metric, root and joints; 0 without a path."""
    if path is None:
        return 0.0
    q, v = path.orientation, path.joint_pos
    turned = metric.root_weight * 0.5 * quaternion.angle_between(q[:-1], q[1:])
    bent = np.sqrt(np.sum(metric.joint_weight * np.diff(v, axis=0) ** 2, axis=1))
    return float(np.sum(turned + bent))


def to_motion(world: World, path: Trajectory, answer: PathAnswer, seed: int) -> Motion:
    """Make a motion of a path: its targets are its angles, and its end is no stand."""
    joined = answer.goal.connection
    made: dict[str, str | float | int] = {
        "program": "getup plan",
        "goal": answer.goal.name,
        "scene": world.scene.name,
        "seed": seed,
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


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPath:
    """A planned path, and figures of the search."""

    request: PlanRequest
    world: World
    start: Fall
    keys: tuple[KeyPosture, ...]
    """Postures to rise through."""
    answer: PathAnswer
    files: tuple[Path, ...] = ()
    """Files that were written."""
    strip_reason: str | None = None
    """Why there is no film strip in the folder."""

    @property
    def found(self) -> bool:
        """Return whether there is a path."""
        return self.answer.found

    @property
    def key_times(self) -> tuple[float | None, ...]:
        """Return the time at which the path leaves each key [s]; None without a path."""
        path, arrivals = self.answer.trajectory, self.answer.arrivals
        if path is None:
            return (None,) * len(self.keys)
        return tuple(float(path.time[row]) for row in arrivals[: len(self.keys)])

    def describe(self) -> dict[str, Any]:
        """Describe the search for JSON."""
        request, answer, world = self.request, self.answer, self.world
        path, joined = answer.trajectory, answer.goal.connection
        return {
            "robot": world.robot.name,
            "scene": request.scene,
            "seed": request.seed,
            "start": request.origin,
            "start_class": self.start.start_class,
            "found": answer.found,
            "goal": answer.goal.name,
            "connection": joined
            and {
                "motion": joined.motion.name,
                "frame": joined.frame,
                "time_s": float(joined.motion.time[joined.frame] - joined.motion.time[0]),
                "distance": joined.distance,
            },
            "status": answer.status.value,
            "reason": answer.reason,
            "leg": answer.leg,
            "refined": answer.refined,
            "way_out_m": answer.way_out and answer.way_out.length,
            "checks": answer.checks,
            "nodes": answer.nodes,
            "time_s": answer.time,
            "duration_s": None if path is None else float(path.time[-1]),
            "length": None if path is None else measure_length(PostureMetric.of(world.robot), path),
            "tried": [{"goal": goal, "reason": reason} for goal, reason in answer.tried],
            "strip_reason": self.strip_reason,
            "keys": [
                {"name": key.name, "time_s": time}
                for key, time in zip(self.keys, self.key_times, strict=True)
            ],
        }


@command("plan", json=PlannedPath.describe)
def plan(request: PlanRequest, monitor: ProgressMonitor) -> PlannedPath:
    """Search a path that is free of collisions, and write it with a film strip if requested."""
    rng = np.random.default_rng(request.seed)
    monitor.begin("loading")
    world = load_world(request)
    keys = load_keys(world, request.key)
    to = [] if request.to is None else load_keys(world, [request.to])
    monitor.begin("falling")
    start = find_start(world, str(request.origin), rng, monitor.tell)
    if to:
        goals = [Goal(name=to[0].name, posture=to[0].posture)]
    else:
        last = keys[-1].posture if keys else start.posture
        goals = choose_goals(load_database(world.robot), last)

    options = PathOptions(max_checks=request.max_checks, refines=request.refinement)
    answer = find_path(world, start.posture, keys, goals, rng, options, monitor)
    found = PlannedPath(request=request, world=world, start=start, keys=tuple(keys), answer=answer)
    if request.out is None:
        return found
    monitor.begin("drawing")
    with staging(request.out, FILES) as folder:
        strip_reason = _write(found, folder)
        files = tuple(request.out / name for name in FILES if (folder / name).exists())
    return replace(found, files=files, strip_reason=strip_reason)


def _write(found: PlannedPath, folder: Path) -> str | None:
    """Write the path and its film strip; return why there is no strip."""
    answer, request, world = found.answer, found.request, found.world
    if answer.trajectory is None:
        return "there is no path"
    motion = to_motion(world, answer.trajectory, answer, request.seed)
    motion.save(folder / PATH)
    title = f"{world.robot.name}, {world.scene.name}: path to {answer.goal.name}, no physics"
    try:
        draw_motion(world.robot, motion, folder / STRIP, scene=world.scene, title=title)
    except NoRendererError as error:
        return str(error)
    return None


@plan.show
def _print(found: PlannedPath, request: PlanRequest, console: Console) -> int:
    """Print the outcome in one line, and the figures."""
    record, files = found.describe(), ", ".join(map(str, found.files))
    effort = f"{record['checks']} checks in {record['time_s']:.1f} s"
    if not found.found:
        where = f"no path to {record['goal']} after {effort}: {record['reason']}"
        if record["status"] == SearchStatus.BUDGET_SPENT.value:
            where += f"; next: a higher --max-checks than {request.max_checks}"
        console.print(f"[bold red]{escape(where)}", soft_wrap=True)
        return NO_PATH
    took = f"{record['duration_s']:.2f} s, length {record['length']:.1f}"
    headline = f"path to {record['goal']}: {took}"
    console.print(f"[bold green]{escape(headline)}")
    table = Table.grid(padding=(0, 2))
    how = "refined from loose to strict" if record["refined"] else "strict constraints"
    rows = {
        "start": f"{record['start_class']}, seed {record['seed']}",
        "search": f"{effort}, {record['nodes']} nodes, {how}",
        "way out": record["way_out_m"]
        and f"{record['way_out_m']:.2f} m, moved as it lies: a rise crawls",
        "keys": ", ".join(f"{key['name']} at {key['time_s']:.2f} s" for key in record["keys"]),
        "files": files,
        "no film": record["strip_reason"],
    }
    for label, text in rows.items():
        if text:
            table.add_row(f"[dim]{label}", escape(text))
    console.print(table)
    return DID_IT
