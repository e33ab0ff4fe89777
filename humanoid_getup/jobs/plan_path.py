"""Plans a path from a lying posture to a stored motion, or to any posture, without physics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import find_start, load_keys, load_world
from humanoid_getup.experiments.starts.falls import Fall
from humanoid_getup.jobs.requests.motions import PlanRequest
from humanoid_getup.motions.key_posture import KeyPosture
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.path_planner import PathOptions
from humanoid_getup.planning.path_query import Goal, PathAnswer, choose_goals, find_path
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.simulation.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPath:
    """A planned path, and figures of the search."""

    world: World
    start: Fall
    keys: tuple[KeyPosture, ...]
    """Postures to rise through."""
    answer: PathAnswer

    @property
    def found(self) -> bool:
        """Return whether there is a path."""
        return self.answer.found

    @property
    def key_times(self) -> tuple[float | None, ...]:
        """Return the time at which the path leaves each key [s]; None if it does not reach it."""
        path, arrivals = self.answer.path, self.answer.result.arrivals
        if path is None:
            return tuple(None for _ in self.keys)
        return tuple(
            float(path.time[arrivals[number]]) if number < len(arrivals) else None
            for number in range(len(self.keys))
        )


def plan(
    request: PlanRequest, report: Report | None = None, cancel: Cancel | None = None
) -> PlannedPath:
    """Search a path that is free of collisions.

    Raises:
        BadInputError: if robot, scene, start or a posture cannot be used.
        CancelledError: if ``cancel`` ended it.
    """
    PlanRequest.accept(request)
    monitor, rng = ProgressMonitor(report, cancel), np.random.default_rng(request.seed)
    monitor.begin("loading")
    world = load_world(request)
    keys = load_keys(world, request.key)
    to = [] if request.to is None else load_keys(world, [request.to])
    monitor.begin("falling")
    start = find_start(world, str(request.origin), rng)
    if to:
        goals = [Goal(name=to[0].name, posture=to[0].posture)]
    else:
        last = keys[-1].posture if keys else start.posture
        with refusing():
            goals = choose_goals(load_database(world.robot), last)

    def show(goal: str, looseness: float | None) -> None:
        tight = "" if looseness is None else f", constraints tightened to {1 - looseness:.0%}"
        monitor.begin(f"planning to {goal}{tight}")

    options = PathOptions(max_checks=request.max_checks, refines=request.refinement)
    answer = find_path(world, start.posture, keys, goals, rng, options, show)
    return PlannedPath(world=world, start=start, keys=tuple(keys), answer=answer)
