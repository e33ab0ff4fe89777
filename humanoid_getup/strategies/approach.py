"""Approach: motions to join from where a robot lies, stored or found, and ways to them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.falls import find_side
from humanoid_getup.filtering.candidate import Candidate, straight_path
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.motion_database import Connection, KeyPosture, MotionDatabase
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.collision import CollisionChecker, Tolerances
from humanoid_getup.planning.path_planner import PathOptions, place_stops, plan_path, plan_via
from humanoid_getup.planning.placement import GoalPlacement
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.quaternion import Array

if TYPE_CHECKING:  # a rise that joins a stored motion does not wait for their imports
    from humanoid_getup.posture_chains.crawl_search import CrawlSearch
    from humanoid_getup.posture_chains.motion_maker import StartMotions

STRAIGHT_SPEED = 3.0  # rad/s of the fastest joint on a path without a plan
SLOW = 0.6  # tempo at which a robot with interlocked limbs is moved without a path
INTERLOCKED = Tolerances(body=0.003)  # for limbs that have to slide along each other
MOST_FAILURES = 2  # searches without a path before the start counts as blocked
MOST_FAILURES_IN_ALL = 5  # before the other motions are not tried, either
OPTIONS = PathOptions(max_checks=40_000)  # about a second: there are other motions to join


class Approach:
    """Finds paths to connecting postures in one scene."""

    def __init__(
        self, world: World, *, planning: bool, monitor: ProgressMonitor | None = None
    ) -> None:
        """Prepare to plan paths; without planning they are straight."""
        self._world, self.planning = world, planning
        self._monitor = monitor or ProgressMonitor()
        self._goals = GoalPlacement(world)
        self._checker = CollisionChecker(world.robot, world.scene)
        self._loose_checker = CollisionChecker(world.robot, world.scene, INTERLOCKED)

    def path(
        self, start: Posture, connection: Connection, rng: np.random.Generator
    ) -> Trajectory | None:
        """Find a smooth path to a connecting posture; ``None`` if there is none."""
        if not self.planning:
            return self._straight(start, connection)
        self._monitor.begin(
            f"planning a path to {connection.motion.name}, frame {connection.frame}"
        )
        goal = self._goals.place(connection.posture, start)
        if goal is None:
            return None
        for checker in (self._checker, self._loose_checker):
            path = plan_path(start, goal, checker, rng, OPTIONS).trajectory
            if path is not None:
                return path
        return None

    def candidates(
        self,
        start: Posture,
        connections: list[Connection],
        rng: np.random.Generator,
        before: Array | None = None,
    ) -> list[Candidate]:
        """Plan from a posture to connecting ones, and return candidates for those with a path.

        After two failures and no path the start itself counts as blocked, and the others are not
        tried; nor are they after five failures.
        ``before`` are targets [rad], (T, n), that led to the start.
        """
        candidates: list[Candidate] = []
        for tried, connection in enumerate(connections):
            failures = tried - len(candidates)
            if failures == (MOST_FAILURES_IN_ALL if candidates else MOST_FAILURES):
                break
            path = self.path(start, connection, rng)
            if path is not None:
                candidates.append(Candidate(path=path, connection=connection, before=before))
        return candidates

    def move_straight(
        self, start: Posture, connections: list[Connection], before: Array | None = None
    ) -> list[Candidate]:
        """Move straight and slowly without a path: limbs may yield."""
        return [
            Candidate(path=self._straight(start, c), connection=c, tempo=SLOW, before=before)
            for c in connections
        ]

    def _straight(self, start: Posture, connection: Connection) -> Trajectory:
        period = self._world.robot.control_period
        return straight_path(start, align(connection.posture, start), STRAIGHT_SPEED, period)


class MotionFinder:
    """Finds motions to join from one start, and crawls, by searches over resting postures.

    An addition to [Lin12], whose rises join motions of a database.
    """

    def __init__(
        self,
        world: World,
        settings: PlannerSettings = DEFAULTS,
        known: Sequence[Motion] = (),
        *,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        self._world, self._settings, self._known = world, settings, known
        self._monitor = monitor
        self._begun: list[CrawlSearch | StartMotions] = []

    def begin(self) -> None:
        """Count simulated time from 0, for a new plan."""
        for search in self._begun:
            search.simulated = 0.0

    @property
    def simulated(self) -> float:
        """Return the time simulated for this plan [s]."""
        return sum(search.simulated for search in self._begun)

    def find(self, start: Posture, budget: float, rng: np.random.Generator) -> list[Connection]:
        """Find motions from a posture at rest on free ground, to be joined at their first frames.

        They are versions of one, the shortest first; there is none if none is found in a simulated
        time [s], or if the robot cannot rise.
        """
        motions = self._search.find(start, find_side(start), budget, rng)
        return [Connection(motion, 0, 0.0) for motion in motions]

    @cached_property
    def crawls(self) -> CrawlSearch:
        """Return the search for crawls, which withstand what rises have to."""
        from humanoid_getup.posture_chains.crawl_search import CrawlSearch

        search = CrawlSearch(
            self._world,
            self._settings.torque_limit,
            CHECK_DISTURBANCE,
            threads=self._settings.threads,
            monitor=self._monitor,
        )
        self._begun.append(search)
        return search

    @cached_property
    def _search(self) -> StartMotions:
        from humanoid_getup.posture_chains.motion_maker import StartMotions

        search = StartMotions(
            self._world,
            self._settings.torque_limit,
            self._known,
            threads=self._settings.threads,
            monitor=self._monitor,
        )
        self._begun.append(search)
        return search


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
