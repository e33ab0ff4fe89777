"""Keyed rise: a rise through key postures, which are kept where physics permits."""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, islice

import numpy as np

from humanoid_getup.filtering.candidate import Candidate, CandidateRollout
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.motion_database import Connection, KeyPosture, MotionDatabase
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.path_planner import REST, PathOptions, place_stops, plan_via
from humanoid_getup.planning.rrt_blossom import SearchStatus
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.free_rise import SLOWDOWN
from humanoid_getup.strategies.key_record import (
    CLOSE_TILT,
    KeyFigures,
    KeyPass,
    KeyRecord,
    find_passes,
)
from humanoid_getup.strategies.rise_search import FoundRise, RiseSearch, SearchTools
from robots import Posture
from robots.quaternion import Array

STRETCHES = 2  # stored motions that may lead to a key, beside the path straight to it
CONNECTIONS = 2  # motions that may be joined after the last key
MOST_WAYS = 8  # combinations that are planned
CHECKS = 60_000  # postures that the search for one path may check
RESTS = (REST, 0.0)  # s at each key: where none stands that rests, some may that go on


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


CORRECTIONS = 3  # times that targets are shifted by the error at each key
FLAT, FADE = 0.1, 0.3  # s around a key in which targets are shifted in full, and until not at all
MOST_SELECTIONS = 7  # of keys, that are tried one after the other
FINALISTS = 4  # rollouts that may be checked against disturbances


@dataclass
class _Passing:
    """A rollout, and its passes of the keys."""

    rollout: CandidateRollout
    passes: list[KeyPass]

    @property
    def distance(self) -> float:
        return max(one.distance for one in self.passes)

    @property
    def lost(self) -> int:
        return sum(not one.is_kept for one in self.passes)


@dataclass
class _Tries:
    """Rollouts through some of the keys."""

    count: int = 0
    standing: list[_Passing] = field(default_factory=list)
    plan_s: float = 0.0
    reason: str = ""
    """Why the last way without a path has none."""


class KeyedRise:
    """Searches for a rise that passes through key postures."""

    def __init__(self, tools: SearchTools, keys: Sequence[KeyPosture]) -> None:
        self._tools, self._world, self._keys = tools, tools.world, tuple(keys)

    def search(self, start: Posture, rng: np.random.Generator) -> FoundRise:
        """Search from a posture at rest; the same arguments give the same result.

        All keys are tried together; if no rise that keeps any of them stands, some are left out.
        """
        reasons, rounds, plan_s = dict[int, str](), 0, 0.0
        for keys in self._list_selections():
            search = RiseSearch(
                self._tools, start, rng, lambda one, keys=keys: self._pass(one, keys).lost
            )
            tries = self._roll_out(search, start, keys, rng)
            search.check_all([one.rollout for one in tries.standing], FINALISTS)
            if search.found.rollout is not None and not search.is_done:
                search.vary()
            search.improve()
            found = search.found
            rounds, plan_s = rounds + found.rounds, plan_s + tries.plan_s
            best = found.rollout and self._pass(found.rollout, keys)
            if best and best.lost < len(keys):
                records = self._record(best.passes, keys, reasons)
                return replace(found, keys=records, planned=True, rounds=rounds, plan_s=plan_s)
            reasons |= {id(key): self._explain(tries, n) for n, key in enumerate(keys)}
        return FoundRise(keys=self._record([], [], reasons), rounds=rounds, plan_s=plan_s)

    def _list_selections(self) -> list[tuple[KeyPosture, ...]]:
        """List all keys, then the selections with one key less, and so on, each in their order."""
        sizes = range(len(self._keys), 0, -1)
        selections = (chosen for size in sizes for chosen in combinations(self._keys, size))
        return list(islice(selections, MOST_SELECTIONS))

    def _roll_out(
        self,
        search: RiseSearch,
        start: Posture,
        keys: Sequence[KeyPosture],
        rng: np.random.Generator,
    ) -> _Tries:
        """Roll out ways with rests at the keys, else without; correct those that stand."""
        tools, tries = self._tools, _Tries()
        routes = KeyRoutes(self._world, tools.database, rng, tools.monitor)
        for rest in RESTS:
            began = time.perf_counter()
            planned = routes.plan(start, keys, rest)
            tries.plan_s += time.perf_counter() - began
            tries.reason = routes.reason
            if not planned:
                break
            slow = [replace(candidate, slowdown=SLOWDOWN) for candidate in planned]
            rolled = search.roll_out(planned + slow)
            tries.count += len(rolled)
            passing = [self._pass(one, keys) for one in rolled if one.stood]
            if passing:
                tries.standing += self._correct(start, passing, keys)
            if any(one.lost == 0 for one in tries.standing):
                break
        return tries

    def _pass(self, rollout: CandidateRollout, keys: Sequence[KeyPosture]) -> _Passing:
        passes = find_passes(self._world, rollout.qpos, [key.posture for key in keys])
        return _Passing(rollout, passes)

    def _correct(
        self, start: Posture, passing: list[_Passing], keys: Sequence[KeyPosture]
    ) -> list[_Passing]:
        """Shift targets around each key repeatedly by the remaining error.

        Servos stay behind their targets by their load. Of each rollout the closest is kept that
        still stands.
        """
        best, last = list(passing), passing
        shifts = [np.zeros_like(one.rollout.target[: one.rollout.moving]) for one in passing]
        for _ in range(CORRECTIONS):
            for shift, begun, one in zip(shifts, passing, last, strict=True):
                for at, error in zip(begun.passes, one.passes, strict=True):
                    shift += self._bump(len(shift), at.frame) * error.joint_error
            targets = [
                self._world.robot.limit_targets(
                    one.rollout.target[: len(shift)] + shift, start.joint_pos
                )
                for one, shift in zip(passing, shifts, strict=True)
            ]
            rolled = self._tools.filter.replay(start, [one.rollout for one in passing], targets)
            last = [self._pass(one, keys) for one in rolled]
            best = [
                new if new.rollout.stood and new.distance < old.distance else old
                for old, new in zip(best, last, strict=True)
            ]
        return best

    def _bump(self, length: int, frame: int) -> Array:
        """Return the share of a shift around a frame, (length, 1): smoothly from 1 to 0."""
        away = np.abs(np.arange(length) - frame) * self._world.robot.control_period
        share = np.clip(1.0 - (away - FLAT) / FADE, 0.0, 1.0)
        return (share * share * (3.0 - 2.0 * share))[:, None]

    def _record(
        self, passes: Sequence[KeyPass], keys: Sequence[KeyPosture], reasons: dict[int, str]
    ) -> tuple[KeyRecord, ...]:
        passed = {id(key): one for key, one in zip(keys, passes, strict=True)}
        return tuple(
            KeyRecord(
                posture=key.posture,
                figures=self._measure_pass(key.name, passed[id(key)])
                if id(key) in passed
                else KeyFigures(name=key.name, kept=False, reason=reasons[id(key)]),
            )
            for key in self._keys
        )

    def _measure_pass(self, name: str, one: KeyPass) -> KeyFigures:
        return KeyFigures(
            name=name,
            kept=one.is_kept,
            time_s=(one.frame + 1) * self._world.robot.control_period,
            largest_joint_error_rad=one.largest,
            tilt_error_rad=one.tilt,
            reason="" if one.is_kept else self._describe(one),
        )

    def _describe(self, one: KeyPass) -> str:
        """Describe the distance at which a motion passes a key posture."""
        worst = int(np.argmax(np.abs(one.joint_error)))
        name = self._world.robot.joint_names[worst]
        text = f"the nearest that it comes: joint '{name}' {one.largest:.2f} rad off"
        return f"{text}, torso {one.tilt:.2f} rad" if one.tilt > CLOSE_TILT else text

    def _explain(self, tries: _Tries, number: int) -> str:
        """Describe why the last of several keys, with its number from 0, was dropped."""
        if not tries.count:
            return tries.reason
        if not tries.standing:
            return f"no rollout through it ends in a held stand: {tries.count} tried"
        best = min(tries.standing, key=lambda one: one.passes[number].distance)
        if not best.passes[number].is_kept:
            return f"of those that stand, {self._describe(best.passes[number])}"
        return "no rollout through it stands in any disturbed check"
