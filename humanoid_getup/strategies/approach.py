"""Approach: motions to join from where a robot lies, stored or found, and ways to them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.falls import find_side
from humanoid_getup.filtering.candidate import Candidate, straight_path
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.collision import CollisionChecker, Tolerances
from humanoid_getup.planning.path_planner import PathOptions, plan_path
from humanoid_getup.planning.placement import GoalPlacement
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
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

    def reset_count(self) -> None:
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
