"""Key routes: ways from where a robot lies through key postures to a stored motion."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.motion_database import Connection, KeyPosture, MotionDatabase
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.key_path import place_stops, plan_via
from humanoid_getup.planning.path_planner import PathOptions
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Posture

STRETCHES = 2  # stored motions that may lead to a key, beside the path straight to it
CONNECTIONS = 2  # motions that may be joined after the last key
MOST_WAYS = 8  # combinations that are planned
CHECKS = 60_000  # postures that the search for one path may check


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A stretch of a stored motion that leads from near one posture to near another."""

    motion: Motion
    first: int
    last: int
    distance: float
    """Posture metric from the one posture to its first frame and from its last to the other."""


def find_stretches(
    database: MotionDatabase, start: Posture, key: Posture, count: int
) -> list[Stretch]:
    """Find the stretch of each stored motion that leads most closely from start to key.

    They begin at an entry frame.
    """
    metric, found = database.metric, list[Stretch]()
    for motion in database.rising:
        far = metric.distance(key.orientation, key.joint_pos, motion.orientation, motion.joint_pos)
        last = int(np.argmin(far))
        entries = motion.entry_frames[motion.entry_frames < last]
        if len(entries) == 0:
            continue
        near = metric.distance(
            start.orientation,
            start.joint_pos,
            motion.orientation[entries],
            motion.joint_pos[entries],
        )
        row = int(np.argmin(near))
        found.append(
            Stretch(
                motion=motion,
                first=int(entries[row]),
                last=last,
                distance=float(far[last] + near[row]),
            )
        )
    return sorted(found, key=lambda stretch: stretch.distance)[:count]


class KeyRoutes:
    """Plans ways from a start through key postures to a stored motion.

    A path of postures alone rolls no robot over and sits none up; a stored motion does. So a key
    posture is approached on a path, or by the motion that passes nearest to it.
    """

    def __init__(
        self,
        world: World,
        database: MotionDatabase,
        rng: np.random.Generator,
        monitor: ProgressMonitor,
    ) -> None:
        self._world, self._database, self._rng = world, database, rng
        self._monitor = monitor
        self._checker = CollisionChecker(world.robot, world.scene)
        self._options = PathOptions(max_checks=CHECKS)
        self.reason = ""
        """Why the last way without a path has none."""

    def plan(self, start: Posture, keys: Sequence[KeyPosture], rest: float) -> list[Candidate]:
        """Plan candidates that rest at each key for a time [s].

        Each key is approached on a path, or by one of the stored motions that lead there; after
        the last one the nearest of them are joined.
        """
        ways, before = list[list[Stretch | None]](), start
        for key in keys:
            stretches = find_stretches(self._database, before, key.posture, STRETCHES)
            ways.append([None, *stretches])
            before = key.posture
        near = self._database.select(keys[-1].posture, CONNECTIONS)
        combined = itertools.product(near, itertools.product(*ways))
        if rest == 0.0:  # first, continuations of the motion that led to the last key
            swings = [
                (Connection(way[-1].motion, way[-1].last, 0.0), way)
                for way in itertools.product(*ways)
                if way[-1] is not None
            ]
            combined = itertools.chain(swings, combined)
        combined = itertools.islice(combined, MOST_WAYS)
        found = (self._plan_way(start, keys, way, last, rest) for last, way in combined)
        return [candidate for candidate in found if candidate is not None]

    def _plan_way(
        self,
        start: Posture,
        keys: Sequence[KeyPosture],
        way: Sequence[Stretch | None],
        joined: Connection,
        rest: float,
    ) -> Candidate | None:
        names = ", ".join(key.name for key in keys)
        self._monitor.begin(f"planning a path through {names} to {joined.motion.name}")
        robot, period = self._world.robot, self._world.robot.control_period
        path, course = None, Course.at(start)
        for key, stretch in zip(keys, way, strict=True):
            if stretch is not None:
                first = self._go(course, stretch.motion.posture(stretch.first))
                if first is None:
                    return None
                path, course = self._begin(path, course, first)
                course = course.play(stretch.motion, stretch.first, stretch.last, period)
            leg = self._go(course, key.posture)
            if leg is None:
                return None
            path, course = self._begin(path, course, leg)
            course = course.rest(rest, period)
        leg = self._go(course, joined.posture)
        if leg is None or path is None:
            return None
        course = course.follow(leg, robot).play(joined.motion, joined.frame, None, period)
        whole = Connection(course.to_motion(joined.motion, period), 0, joined.distance)
        return Candidate(path=path, connection=whole)

    def _begin(
        self, path: Trajectory | None, course: Course, leg: Trajectory
    ) -> tuple[Trajectory, Course]:
        """Take the first leg as the path of the candidate, and follow the later ones."""
        if path is None:
            return leg, Course.at(leg.posture(-1))
        return path, course.follow(leg, self._world.robot)

    def _go(self, course: Course, goal: Posture) -> Trajectory | None:
        """Plan a path from the end of a course; ``None`` without one."""
        (stop,) = place_stops(self._world, [goal], course.end)
        if stop is None:
            self.reason = "there is no place for it at the robot or beside it"
            return None
        found = plan_via(course.end, [stop], self._checker, self._rng, self._options)
        if found.status is not SearchStatus.SOLVED:
            self.reason = f"no path: {found.reason}"
        return found.trajectory
