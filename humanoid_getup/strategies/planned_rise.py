"""Plans a rise: from a lying posture to a motion whose rollouts end standing."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from humanoid_getup.filtering.candidate import Candidate, Patience
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE, DynamicsFilter
from humanoid_getup.motions.key_posture import KeyPosture, name_keys
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.motion_database import Connection, MotionDatabase, load_database
from humanoid_getup.motions.preference import PreferenceName
from humanoid_getup.planning.key_check import check_keys
from humanoid_getup.simulation.standing_places import StandingPlaces
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import Approach
from humanoid_getup.strategies.continuation import Continuation
from humanoid_getup.strategies.crawl import Crawl, Move
from humanoid_getup.strategies.keys.key_postures import KeyedSearch
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, RiseStatus
from humanoid_getup.strategies.rise_motion import chain, make_motion, make_move
from humanoid_getup.strategies.rise_search import FINALISTS, RiseSearch, SearchTools
from humanoid_getup.strategies.search_record import SearchRecord
from robots import FULL_TORQUE, Posture, TorqueLimit
from robots.body.lengths import leg_length
from robots.torque_limit import check_torque_limit

PATIENT = Patience(tolerance=0.15, band=0.15, slowest=0.2)
OTHER_PATIENCE = (
    Patience(tolerance=0.25, band=0.15, slowest=0.2),
    Patience(tolerance=0.15, band=0.15, slowest=0.4),
)
FIRST_CONNECTIONS, MORE_CONNECTIONS = 3, 3
# Where motions were not made for the scene, more of them are tried.
MORE_IN_SCENES, SECOND_ON_UNEVEN, MORE_FINALISTS = 19, 6, 6
CRAMPED = 0.3  # leg lengths from a place to stand, from which a robot crawls before it rises
REFITS = 3
SEARCH_BUDGET = 600.0  # s of simulated time in which a search varies a rollout's targets
MOST_BUDGET, MOST_ASSISTANCE = 1e6, 10.0
SECOND_TRIES = 2  # rounds that continue from the ends of failed rollouts
TRIES_AMONG_OBSTACLES = 4


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
        threads: int = 0,
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
            threads: That step physics; 0 for one per processor. They change no result.

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
        self.filter = DynamicsFilter(
            world, torque_limit=self.torque_limit, prefer=prefer, threads=threads
        )
        self._crawl = Crawl(world, self.torque_limit, CHECK_DISTURBANCE, threads=threads)
        self._leg = leg_length(world.robot)
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
        search = self._begin(start, rng)
        search.best, search.robust, search.rounds = through.rollout, through.robust, through.rounds
        search.planned = True
        plan = self._conclude(
            search,
            None,
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
        slower paths, or legs that fit the ground better where it is uneven; if those fail, too,
        new paths from where their rollouts ended. What stands is improved by a search, where more
        is preferred. A robot so tangled that no path leaves its posture is first pulled free by its
        servos. One without room to stand where it lies crawls first: the plan is a move then,
        after which it has to be planned for again.
        """
        began = time.perf_counter()
        more = MORE_CONNECTIONS if self.world.scene.is_flat else MORE_IN_SCENES
        connections = self.database.select(start, FIRST_CONNECTIONS + more)
        if not self.filtering:
            path = self._approach.path(start, connections[0], rng)
            return self._chain_unfiltered(connections[0], path, time.perf_counter() - began)
        search, first = self._begin(start, rng), list[Candidate]()
        already, searched = self.filter.count, self._searched
        places = self._find_standing_places(search.start)
        move = None
        if places and places.distance(start.position) > CRAMPED * self._leg:
            move = search.crawl(self._crawl, places)
        if move is None:
            first = search.plan(connections[:FIRST_CONNECTIONS])
        plan_s = time.perf_counter() - began
        began = time.perf_counter()
        if move is None:
            self._search(search, first, connections, places)
        return self._conclude(
            search,
            move,
            rollouts=self.filter.count - already,
            searched=self._searched - searched,
            plan_s=plan_s,
            filter_s=time.perf_counter() - began,
        )

    def _search(
        self,
        search: RiseSearch,
        first: list[Candidate],
        connections: list[Connection],
        places: StandingPlaces | None,
    ) -> None:
        search.try_all(first)
        if not first:
            search.try_all(search.pull_free(connections[:FIRST_CONNECTIONS]))
        if first and (not search.is_done or self.filter.preference.is_demanding):
            further = search.plan(connections[FIRST_CONNECTIONS:])
            if self._is_level:
                finalists = FINALISTS if self.world.scene.is_flat else MORE_FINALISTS
                search.try_all(further + _make_patient(first + further), finalists)
            else:
                search.try_all(first + further, MORE_FINALISTS)
                search.refit(REFITS, MORE_FINALISTS)
        if not search.is_done:
            search.vary()
        if search.tried and not search.is_done:
            search.try_all([replace(c, patience=p) for p in OTHER_PATIENCE for c in first])
        continuation = Continuation(self.world, places)
        for _ in range(SECOND_TRIES if places is None else TRIES_AMONG_OBSTACLES):
            if search.is_done:
                break
            if self._is_level:
                search.go_on(continuation)
            else:
                search.go_on(continuation, SECOND_ON_UNEVEN, MORE_FINALISTS)
                search.refit(REFITS, MORE_FINALISTS)
        search.improve()

    def _begin(self, start: Posture, rng: np.random.Generator) -> RiseSearch:
        tools = SearchTools(
            database=self.database,
            approach=self._approach,
            filter=self.filter,
            assistance=self.assistance,
            budget=self.search_budget,
        )
        return RiseSearch(tools, start, rng)

    def _find_standing_places(self, start: Posture) -> StandingPlaces | None:
        """Find where the robot has room to stand; ``None`` without obstacles."""
        places = StandingPlaces(self.world, start.position)
        return places if self.world.scene.obstacles and places.exist else None

    @property
    def _is_level(self) -> bool:
        return self.world.scene.ground.is_level

    @property
    def _searched(self) -> float:
        """Return the time that searches have simulated so far [s]."""
        return self.filter.searched + self._crawl.simulated

    def _conclude(
        self,
        search: RiseSearch,
        move: Move | None,
        *,
        rollouts: int,
        searched: float,
        plan_s: float,
        filter_s: float,
    ) -> RisePlan:
        record = SearchRecord(
            prefer=self.prefer,
            budget=self.search_budget,
            simulated=searched,
            outcome=search.best and search.best.outcome,
            before=search.before and search.before.outcome,
        )
        figures: dict[str, Any] = {
            "planned": search.planned,
            "robust": search.robust,
            "rollouts": rollouts,
            "rounds": search.rounds,
            "plan_s": plan_s,
            "filter_s": filter_s,
            "search": record,
        }
        if move is not None:
            motion = make_move(self.world, search.start, move)
            return MotionPlan(status=RiseStatus.MOVES, motion=motion, **figures)
        if search.best is not None:
            return MotionPlan(
                status=RiseStatus.STOOD,
                motion=make_motion(self.world, search.start, search.best),
                connection=search.best.candidate.connection,
                stand_time=float(search.best.outcome.stand_time),
                **figures,
            )
        if not search.tried:
            return RisePlan(status=RiseStatus.NOT_PLANNED, **figures)
        share = search.highest / self.world.robot.standing_neck_height
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


def _make_patient(candidates: list[Candidate]) -> list[Candidate]:
    return [replace(c, patience=PATIENT) for c in candidates]
