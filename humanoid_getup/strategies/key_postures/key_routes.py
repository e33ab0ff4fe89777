"""The ways through key postures that are worth a rollout, each planned in the scene."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.motions.key_posture import KeyPosture
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.motion_database import Connection, MotionDatabase
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.path_planner import PathOptions
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.planning.via import REST, place_stops, plan_via
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.key_postures.key_route import Route, Stretch, find_stretches
from robots import Posture

STRETCHES = 2  # stored motions that may lead to a key, beside the path straight to it
CONNECTIONS = 2  # motions that may be joined after the last key
MOST_WAYS = 8  # combinations that are planned
CHECKS = 60_000  # postures that the search for one path may check
RESTS = (REST, 0.0)  # s at each key: where none stands that rests, some may that go on


class KeyRoutes:
    """Plans ways from a start through key postures to a stored motion."""

    def __init__(self, world: World, database: MotionDatabase, rng: np.random.Generator) -> None:
        """Prepare to plan with one random generator."""
        self._world, self._database, self._rng = world, database, rng
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
        if rest == 0.0:  # first, what swings on as the motion does that led to the last key
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
        path, route = None, Route(self._world, start)
        for key, stretch in zip(keys, way, strict=True):
            if stretch is not None:
                first = self._go(route, stretch.motion.posture(stretch.first))
                if first is None:
                    return None
                path, route = self._begin(path, route, first)
                route.play(stretch.motion, stretch.first, stretch.last)
            leg = self._go(route, key.posture)
            if leg is None:
                return None
            path, route = self._begin(path, route, leg)
            route.rest(rest)
        leg = self._go(route, joined.posture)
        if leg is None or path is None:
            return None
        route.follow(leg)
        route.play(joined.motion, joined.frame)
        whole = Connection(route.to_motion(joined.motion), 0, joined.distance)
        return Candidate(path=path, connection=whole)

    def _begin(
        self, path: Trajectory | None, route: Route, leg: Trajectory
    ) -> tuple[Trajectory, Route]:
        """Take the first leg as the path of the candidate, and follow the later ones."""
        if path is None:
            return leg, Route(self._world, leg.posture(-1))
        route.follow(leg)
        return path, route

    def _go(self, route: Route, goal: Posture) -> Trajectory | None:
        """Plan a path from where a route has come to; ``None`` without one."""
        (stop,) = place_stops(self._world, [goal], route.posture)
        if stop is None:
            self.reason = "there is no place for it at the robot or beside it"
            return None
        found = plan_via(route.posture, [stop], self._checker, self._rng, self._options)
        if found.status is not SearchStatus.SOLVED:
            self.reason = f"no path: {found.reason}"
        return found.trajectory
