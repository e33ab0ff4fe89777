"""Plans a rise: from a lying posture to a motion whose rollouts end standing."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.falls import CLASSES, classify, find_side
from humanoid_getup.filtering.candidate import CandidateRollout
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.motions.course import Course, record_motion
from humanoid_getup.motions.motion import NO_END, Motion, Trajectory
from humanoid_getup.motions.motion_database import (
    Connection,
    KeyPosture,
    MotionDatabase,
    load_database,
    name_body,
    name_keys,
    suggest_motions,
)
from humanoid_getup.planning.collision import check_keys
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import Approach, MotionFinder
from humanoid_getup.strategies.free_rise import FreeRise
from humanoid_getup.strategies.keyed_rise import KeyedRise
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.rise_search import FoundRise, SearchTools
from robots import Posture
from robots.arguments import expect

if TYPE_CHECKING:
    from humanoid_getup.posture_chains.crawl_search import Crawl


class PlannedRise:
    """Plans the rises of one robot in one scene."""

    def __init__(
        self,
        world: World,
        database: MotionDatabase | None = None,
        settings: PlannerSettings = DEFAULTS,
        *,
        keys: Sequence[Posture | KeyPosture] = (),
        monitor: ProgressMonitor | None = None,
    ) -> None:
        """Prepare to plan.

        Args:
            database: Motions to connect to; ``None`` for the robot's own.
            settings: Limits, secondary objective, and what is left out.
            keys: Key postures to rise through, in order; what physics refuses is dropped. They
                require planning and filtering.
            monitor: Shows the steps of each plan, and ends it between two of them if it is
                canceled.
        """
        expect("world", world, World, "a World, e.g. World(robot)")
        expect("settings", settings, PlannerSettings, "e.g. PlannerSettings(prefer='torque')")
        monitor = monitor or ProgressMonitor()
        if keys and not (settings.planning and settings.filtering):
            raise ValueError("keys are given, expected planning and filtering with them")
        self.keys = name_keys(keys)
        """Key postures, each with a name."""
        check_keys(world.robot, self.keys)
        self.world, self.torque_limit = world, settings.torque_limit.on(world.robot)
        self.settings = replace(settings, torque_limit=self.torque_limit)
        self.database = load_database(world.robot) if database is None else database
        self.filter = DynamicsFilter(world, self.settings, monitor=monitor)
        self._tools = SearchTools(
            world=world,
            database=self.database,
            approach=Approach(world, planning=settings.planning, monitor=monitor),
            filter=self.filter,
            finder=MotionFinder(world, self.settings, self.database.rising, monitor=monitor),
            budget=settings.search_budget,
            monitor=monitor,
        )

    def __repr__(self) -> str:
        return f"PlannedRise({self.settings.prefer} in {self.world!r})"

    def plan(self, start: Posture, rng: np.random.Generator) -> Plan:
        """Plan a rise from a posture at rest; the same arguments give the same plan.

        Raises `CancelledError` if the planner's monitor is canceled.

        With key postures, a rise that passes through them is searched for first. A robot without
        room to stand crawls first: the plan is then a crawl, after which the rise has to be planned
        again.
        """
        if not self.settings.filtering:
            return self._chain_unfiltered(start, rng)
        began = time.perf_counter()
        self._tools.reset_counts()
        found = keyed = KeyedRise(self._tools, self.keys).search(start, rng)
        if keyed.rollout is None:
            free = FreeRise(self._tools).search(start, rng)
            found = replace(
                free,
                keys=keyed.keys,
                rounds=keyed.rounds + free.rounds,
                plan_s=keyed.plan_s + free.plan_s,
            )
        return self._conclude(start, found, time.perf_counter() - began - found.plan_s)

    def describe_gap(self, side: str | None) -> str:
        """Say that no stored motion begins on a side, and what to do; empty if one does."""
        if side not in CLASSES or side in {motion.start_class for motion in self.database.rising}:
            return ""
        robot = self.world.robot
        return f"'{robot.name}' has no motion from {side}; next: {suggest_motions(robot)}"

    def _conclude(self, start: Posture, found: FoundRise, filter_s: float) -> Plan:
        rollouts, searched = self.filter.count, self._tools.searched
        tried = Plan(
            status=RiseStatus.NOT_PLANNED,
            planned=found.planned,
            robust=found.robust,
            rollouts=rollouts,
            rounds=found.rounds,
            plan_s=found.plan_s,
            filter_s=filter_s,
            settings=self.settings,
            searched=searched,
            rollout=found.rollout and found.rollout.outcome,
            before=found.before and found.before.outcome,
            keys=found.keys,
        )
        if found.crawl is not None:
            motion = make_crawl(self.world, start, found.crawl)
            return replace(tried, status=RiseStatus.MOVES, motion=motion)
        if found.rollout is not None:
            motion = make_motion(self.world, start, found.rollout)
            connection = found.rollout.candidate.connection
            return replace(tried, status=RiseStatus.STOOD, motion=motion, connection=connection)
        gap = self.describe_gap(classify(start.orientation))
        if not found.rolled_out:
            return replace(tried, detail=gap)
        share = found.highest / self.world.robot.standing_neck_height
        along = f", along {found.joined}," if found.joined else ""
        detail = f"{rollouts} tried, the best{along} raised the neck to {share:.0%}"
        detail = "; ".join(filter(None, [detail, gap or self._advise(searched)]))
        return replace(tried, status=RiseStatus.FELL, detail=detail)

    def _advise(self, searched: float) -> str:
        """Suggest options that may lead to a rise after so much simulated time [s]; or nothing."""
        limit, ways = self.torque_limit.value, list[str]()
        if limit is not None:
            ways.append(f"a higher --torque-limit than {limit:g} N·m")
        if searched >= self.settings.search_budget:
            ways.append(f"a longer --search-budget than {self.settings.search_budget:g} s")
        return f"next: {' or '.join(ways)}" if ways else ""

    def _chain_unfiltered(self, start: Posture, rng: np.random.Generator) -> Plan:
        """Chain the smoothed path and the nearest motion without any physics."""
        began = time.perf_counter()
        connection = self.database.select(start, 1)[0]
        path = self._tools.approach.path(start, connection, rng)
        plan_s = time.perf_counter() - began
        if path is None:
            return Plan(
                status=RiseStatus.NOT_PLANNED,
                detail=f"{connection.motion.name} alone was tried; next: leave out --no-filtering",
                connection=connection,
                plan_s=plan_s,
            )
        return Plan(
            status=RiseStatus.UNFILTERED,
            motion=chain(self.world, path, connection),
            tracked=False,
            connection=connection,
            planned=self.settings.planning,
            plan_s=plan_s,
        )


def make_motion(world: World, start: Posture, rollout: CandidateRollout) -> Motion:
    """Make a motion of the postures and the targets of a rollout."""
    joined = rollout.candidate.connection.motion
    return record_motion(
        world,
        start,
        rollout.target[: rollout.moving],
        rollout.qpos,
        name=f"rise_by_{joined.name}",
        start_class=classify(start.orientation) or joined.start_class,
        strategy=joined.strategy,
        provenance={"program": "getup rise", "connection": joined.name} | name_body(world.robot),
    )


def make_crawl(world: World, start: Posture, crawl: Crawl) -> Motion:
    """Make a motion of a crawl, which does not end standing."""
    return record_motion(
        world,
        start,
        crawl.target,
        crawl.qpos,
        name="crawl",
        start_class=find_side(start),
        end_class=NO_END,
        strategy="crawl",
        provenance={"program": "getup rise"} | name_body(world.robot),
    )


def chain(world: World, path: Trajectory, connection: Connection) -> Motion:
    """Chain a path's angles and the motion's own targets, unchanged.

    The motion is turned and moved to the end of the path.
    """
    joined, frame, count = connection.motion, connection.frame, len(path.time)
    aligned = Course.aligned(joined, frame, path.posture(-1), keep_height=False)
    return (
        Course.of(path)
        .then(aligned[frame:])
        .to_motion(
            joined,
            world.robot.control_period,
            name=f"path_to_{joined.name}",
            start_class=classify(path.orientation[0]) or joined.start_class,
            provenance={"program": "getup rise", "connection": joined.name, "path_frames": count}
            | name_body(world.robot),
        )
    )
