"""Plans a rise: from a lying posture to a motion whose rollouts end standing."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from humanoid_getup.evaluation.preference import PreferenceName
from humanoid_getup.filtering.candidate import Candidate, CandidateRollout, Patience
from humanoid_getup.filtering.crawl import Crawl
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE, DynamicsFilter
from humanoid_getup.motions.key_posture import KeyPosture, name_keys
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.motion_database import Connection, MotionDatabase, load_database
from humanoid_getup.planning.key_check import check_keys
from humanoid_getup.simulation.standing_places import StandingPlaces
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import Approach
from humanoid_getup.strategies.continuation import Continuation
from humanoid_getup.strategies.key_postures import KeyedSearch
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, RiseStatus
from humanoid_getup.strategies.rise_motion import chain, make_motion
from humanoid_getup.strategies.search_record import SearchRecord
from robots import FULL_TORQUE, Posture, TorqueLimit
from robots.quaternion import Array
from robots.torque_limit import check_torque_limit

PATIENT = Patience(tolerance=0.15, band=0.15, slowest=0.2)
OTHER_PATIENCE = (
    Patience(tolerance=0.25, band=0.15, slowest=0.2),
    Patience(tolerance=0.15, band=0.15, slowest=0.4),
)
ENOUGH = 1.0  # share of the disturbed rollouts that must stand to stop searching
FINALISTS = 3  # rollouts of a round that may be checked
FIRST_CONNECTIONS, MORE_CONNECTIONS, SECOND_CONNECTIONS = 3, 3, 2
SEARCH_BUDGET = 600.0  # s of simulated time in which a search varies a rollout's targets
MOST_BUDGET, MOST_ASSISTANCE = 1e6, 10.0
SEARCH_STARTS = 2  # failed rollouts that a search begins with, where none stood
SECOND_TRIES = 2  # rounds that continue from the ends of failed rollouts
TRIES_AMONG_OBSTACLES = 4
MOST_MOVES = 6
ROOM = 0.02  # m from a place to stand, from which a robot need not crawl to it


@dataclass
class _Progress:
    """Progress of planning one rise."""

    start: Posture
    rng: np.random.Generator
    tried: list[CandidateRollout] = field(default_factory=list)
    best: CandidateRollout | None = None
    before: CandidateRollout | None = None
    """The rise that was improved."""
    robust: float = float("nan")
    rounds: int = 0
    planned: bool = False

    @property
    def is_done(self) -> bool:
        """Return whether there is a rise that stands under every disturbance."""
        return self.best is not None and self.robust >= ENOUGH


class PlannedRise:
    """Plans the rises of one robot in one scene."""

    def __init__(
        self,
        world: World,
        database: MotionDatabase | None = None,
        *,
        planning: bool = True,
        filtering: bool = True,
        assistance: float = 1.0,
        torque_limit: TorqueLimit = FULL_TORQUE,
        prefer: PreferenceName = "time",
        search_budget: float = SEARCH_BUDGET,
        keys: Sequence[Posture | KeyPosture] = (),
    ) -> None:
        """Prepare to plan.

        Args:
            world: Robot and scene.
            database: Motions to connect to; ``None`` for the robot's own.
            planning: Plan a path to the connecting posture; False: interpolate straight to it.
            filtering: Filter through physics; False: path and motion are played as they are.
            assistance: Share of the virtual actuator's torques that the filter uses.
            torque_limit: Of the servos.
            prefer: What a rise should be besides successful.
            search_budget: Simulated time in which a search may vary a rollout's targets [s].
            keys: Key postures to rise through, in order; what physics refuses is dropped. They
                require planning and filtering.

        Raises:
            ValueError: if the preference is unknown, the budget or assistance out of range, or
                the robot cannot be in a key posture.
        """
        if not 0.0 < search_budget <= MOST_BUDGET:
            raise ValueError(
                f"search_budget is {search_budget} s, expected above 0 s, at most {MOST_BUDGET:g} s"
            )
        if not 0.0 <= assistance <= MOST_ASSISTANCE:
            raise ValueError(
                f"assistance is {assistance}, expected a share from 0 to {MOST_ASSISTANCE:g}"
            )
        self.prefer: PreferenceName = prefer
        self.search_budget = search_budget
        self.world, self.torque_limit = world, check_torque_limit(torque_limit, world.robot)
        self.planning, self.filtering, self.assistance = planning, filtering, assistance
        self.database = load_database(world.robot) if database is None else database
        self._approach = Approach(world, planning=planning)
        self.filter = DynamicsFilter(world, torque_limit=self.torque_limit, prefer=prefer)
        if keys and not (planning and filtering):
            raise ValueError("keys are given, expected planning and filtering with them")
        self.keys = name_keys(keys)
        """Key postures, each with a name."""
        check_keys(world.robot, self.keys)

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise from a posture at rest; the same arguments give the same plan.

        With key postures, a rise that passes through them is searched for first.
        """
        if not self.keys:
            return self._plan_freely(start, rng)
        already, searched = self.filter.count, self._searched
        through = KeyedSearch(
            self.world,
            self.database,
            self.filter,
            self.keys,
            patience=PATIENT,
            assistance=self.assistance,
            search_budget=self.search_budget,
        ).plan(start, rng)
        if through.rollout is None:
            plan = self._plan_freely(start, rng)
            return replace(
                plan,
                keys=through.records,
                rollouts=self.filter.count - already,
                rounds=through.rounds + plan.rounds,
                plan_s=through.plan_s + plan.plan_s,
                filter_s=through.filter_s + plan.filter_s,
            )
        plan = self._conclude(
            _Progress(
                start,
                rng,
                best=through.rollout,
                robust=through.robust,
                rounds=through.rounds,
                planned=True,
            ),
            rollouts=self.filter.count - already,
            searched=self._searched - searched,
            plan_s=through.plan_s,
            filter_s=through.filter_s,
        )
        return replace(plan, keys=through.records)

    def _plan_freely(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise without key postures.

        First the nearest connecting postures of a few motions are tried, and the cheapest rise
        that stands is taken; if none does, or it is not yet as preferred, further motions and
        slower paths; if those fail, too, new paths from where their rollouts ended. What stands
        is improved by a search, where more is preferred. A robot so tangled that no path leaves its
        posture is first pulled free by its servos.
        """
        began = time.perf_counter()
        progress = _Progress(start, rng)
        connections = self.database.select(start, FIRST_CONNECTIONS + MORE_CONNECTIONS)
        if not self.filtering:
            path = self._approach.path(start, connections[0], rng)
            return self._chain_unfiltered(connections[0], path, time.perf_counter() - began)
        first = self._candidates(progress, progress.start, connections[:FIRST_CONNECTIONS])
        plan_s = time.perf_counter() - began
        began = time.perf_counter()
        already, searched = self.filter.count, self._searched
        self._round(progress, first)
        if not first:
            self._round(progress, self._approach.pull_free(start, connections[:FIRST_CONNECTIONS]))
        places = None if progress.best else self._find_standing_places(start)
        if places is not None and self._crawl(progress, places):
            first = []
        if first and (not progress.is_done or self.filter.preference.is_demanding):
            further = self._candidates(progress, progress.start, connections[FIRST_CONNECTIONS:])
            self._round(progress, further + [replace(c, patience=PATIENT) for c in first + further])
        if not progress.is_done:
            self._search(progress)
        if progress.tried and not progress.is_done:
            stubborn = [replace(c, patience=p) for p in OTHER_PATIENCE for c in first]
            self._round(progress, stubborn)
        continuation = Continuation(self.world, places)
        for _ in range(SECOND_TRIES if places is None else TRIES_AMONG_OBSTACLES):
            if not progress.is_done:
                self._try_again(progress, continuation)
        self._improve(progress)
        return self._conclude(
            progress,
            rollouts=self.filter.count - already,
            searched=self._searched - searched,
            plan_s=plan_s,
            filter_s=time.perf_counter() - began,
        )

    def _candidates(
        self,
        progress: _Progress,
        start: Posture,
        connections: list[Connection],
        before: Array | None = None,
    ) -> list[Candidate]:
        """Plan from a posture to connecting ones, and keep those with a path."""
        candidates = self._approach.candidates(start, connections, progress.rng, before)
        progress.planned |= self.planning and before is None and bool(candidates)
        return candidates

    def _find_standing_places(self, start: Posture) -> StandingPlaces | None:
        """Find where the robot has room to stand; ``None`` without obstacles."""
        places = StandingPlaces(self.world, start.position)
        return places if self.world.scene.obstacles and places.exist else None

    def _check(self, progress: _Progress, rollout: CandidateRollout) -> None:
        """Check a rollout that stands, its touching limbs parted; keep it if it is the best."""
        parted = self.filter.separate(progress.start, rollout)
        for one in [parted] if parted is rollout else [parted, rollout]:
            best = progress.best
            if best and progress.is_done and one.cost >= best.cost:
                return
            share = self.filter.check(progress.start, one.target, progress.rng)
            known = (progress.robust, -best.cost) if best else (0.0, 0.0)
            if share > 0.0 and (share, -one.cost) > known:
                progress.best, progress.robust = one, share

    def _improve(self, progress: _Progress) -> None:
        """Vary the targets of a rise that stands everywhere, where more is preferred."""
        best, preference = progress.best, self.filter.preference
        if best and progress.is_done and (preference.is_demanding or best.collides):
            budget = preference.improvement * self.search_budget
            better = self.filter.improve(progress.start, best, budget, progress.rng)
            if better is not best:
                progress.best, progress.before = better, best

    def _search(self, progress: _Progress) -> None:
        """Vary the targets of the best rollout, or of the failed ones that rose highest."""
        failed = sorted(progress.tried, key=lambda r: -r.peak_neck)[:SEARCH_STARTS]
        for base in [progress.best] if progress.best else failed:
            better, share = self.filter.search(
                progress.start, base, self.search_budget, progress.rng
            )
            if better.stood and share > (progress.robust if progress.best else 0.0):
                progress.best, progress.robust = better, share
                if better.collides:
                    self._check(progress, better)
                if progress.is_done:
                    return

    def _crawl(self, progress: _Progress, places: StandingPlaces) -> bool:
        """Crawl to where the robot has room to stand, and rise from there.

        Returns whether it had to.
        """
        posture, held, moves = progress.start, progress.start.joint_pos, []
        while len(moves) < MOST_MOVES and places.distance(posture.position) > ROOM:
            move = self._crawling.search(posture, held, places.distance, progress.rng)
            if move.cost >= places.distance(posture.position):
                break
            posture, held = move.posture, move.target[-1]
            moves.append(move.target)
        if not moves:
            return False
        before = np.concatenate(moves)
        connections = self.database.select(posture, FIRST_CONNECTIONS + MORE_CONNECTIONS)
        found = self._candidates(progress, posture, connections, before)
        found = found or self._approach.pull_free(posture, connections, before)
        self._round(progress, found + [replace(c, patience=PATIENT) for c in found])
        return True

    @property
    def _searched(self) -> float:
        """Return the time that searches have simulated so far [s]."""
        return self.filter.searched + self._crawling.simulated

    @cached_property
    def _crawling(self) -> Crawl:
        return Crawl(self.world, self.torque_limit, CHECK_DISTURBANCE)

    def _try_again(self, progress: _Progress, continuation: Continuation) -> None:
        """Continue from the ends of failed rollouts."""
        candidates = []
        for end in continuation.pick(progress.tried):
            connections = self.database.select(end.posture, SECOND_CONNECTIONS)
            found = self._candidates(progress, end.posture, connections, end.target)
            candidates += found or self._approach.pull_free(end.posture, connections, end.target)
        self._round(progress, candidates)

    def _round(self, progress: _Progress, candidates: list[Candidate]) -> None:
        """Roll candidates out; check the cheapest that stood against disturbances."""
        if not candidates:
            return
        progress.rounds += 1
        candidates = [replace(c, assistance=self.assistance) for c in candidates]
        progress.tried = self.filter.roll_out(progress.start, candidates)
        standing = sorted((r for r in progress.tried if r.stood), key=lambda r: r.cost)
        for finalist in standing[:FINALISTS]:
            self._check(progress, finalist)
            if progress.best and progress.is_done and not progress.best.collides:
                return

    def _conclude(
        self,
        progress: _Progress,
        *,
        rollouts: int,
        searched: float,
        plan_s: float,
        filter_s: float,
    ) -> RisePlan:
        search = SearchRecord(
            prefer=self.prefer,
            budget=self.search_budget,
            simulated=searched,
            figures=progress.best and progress.best.figures,
            before=progress.before and progress.before.figures,
        )
        figures: dict[str, Any] = {
            "planned": progress.planned,
            "robust": progress.robust,
            "rollouts": rollouts,
            "rounds": progress.rounds,
            "plan_s": plan_s,
            "filter_s": filter_s,
            "search": search,
        }
        if progress.best is not None:
            return MotionPlan(
                status=RiseStatus.STOOD,
                motion=make_motion(self.world, progress.start, progress.best),
                connection=progress.best.candidate.connection,
                stand_time=progress.best.stand_time,
                **figures,
            )
        if not progress.tried:
            return RisePlan(status=RiseStatus.NOT_PLANNED, **figures)
        highest = max(r.peak_neck for r in progress.tried)
        share = highest / self.world.robot.standing_neck_height
        detail = f"{rollouts} tried, the best raised the neck to {share:.0%}"
        return RisePlan(status=RiseStatus.FELL, detail=detail, **figures)

    def _chain_unfiltered(
        self, connection: Connection, path: Trajectory | None, plan_s: float
    ) -> RisePlan:
        """Chain the smoothed path and the motion without any physics."""
        if path is None:
            return RisePlan(status=RiseStatus.NOT_PLANNED, connection=connection, plan_s=plan_s)
        return MotionPlan(
            status=RiseStatus.UNFILTERED,
            motion=chain(self.world, path, connection),
            simulated=False,
            connection=connection,
            planned=self.planning,
            plan_s=plan_s,
        )
