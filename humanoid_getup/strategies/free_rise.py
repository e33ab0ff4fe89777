"""Free rise: rounds of candidates until one stands under every disturbance."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.filtering.candidate import Candidate, CandidateRollout, Slowdown
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.simulation.placement import StandingPlaces
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.rise_search import FINALISTS, FoundRise, RiseSearch, SearchTools
from robots import Posture, quaternion
from robots.body.parts import leg_length
from robots.kinematics import read_posture
from robots.quaternion import Array

SETTLE_TIME = 0.6  # s after a failed rollout until the next path begins
UNLIKE = 0.8  # cosine of the angle between attitudes that are alike
MOST_ENDS = 3


@dataclass(frozen=True, kw_only=True)
class End:
    """The end of a failed rollout at rest, and the targets that led there."""

    posture: Posture
    target: Array
    """Targets sent until then [rad], (T, n)."""
    confinement: float
    """Distance from the nearest place where the robot has room to stand [m]."""


class Continuation:
    """Picks the ends of failed rollouts from which another rise is tried."""

    def __init__(self, world: World, places: StandingPlaces | None) -> None:
        """Prepare for a world; ``places`` if it has any obstacles."""
        self._world, self._places = world, places
        self._waiting: list[End] = []

    def pick(self, tried: list[CandidateRollout]) -> list[End]:
        """Pick up to three ends of the last round, of different attitudes.

        Among obstacles those with most room come first, and the others wait for the next time.
        """
        ends = [self._end(failed) for failed in tried if not failed.stood]
        if self._places is not None:
            ends = sorted([*self._waiting, *ends], key=lambda end: end.confinement)
        picked: list[End] = []
        for end in ends:
            if len(picked) < MOST_ENDS and not any(_are_alike(end, other) for other in picked):
                picked.append(end)
        self._waiting = [end for end in ends if not any(end is one for one in picked)]
        return picked

    def _end(self, failed: CandidateRollout) -> End:
        """Cut a rollout at the time from which the robot is at rest."""
        robot, model = self._world.robot, self._world.model
        length = min(failed.moving + round(SETTLE_TIME / robot.control_period), len(failed.target))
        posture = read_posture(robot, model, failed.qpos[length - 1])
        places = self._places
        confinement = 0.0 if places is None else float(places.distance(posture.position))
        return End(posture=posture, target=failed.target[:length], confinement=confinement)


def _are_alike(a: End, b: End) -> bool:
    directions = [quaternion.gravity_in_body(end.posture.orientation) for end in (a, b)]
    return float(directions[0] @ directions[1]) >= UNLIKE


SLOWDOWN = Slowdown(tolerance=0.15, band=0.15, slowest=0.2)
OTHER_SLOWDOWNS = (
    Slowdown(tolerance=0.25, band=0.15, slowest=0.2),
    Slowdown(tolerance=0.15, band=0.15, slowest=0.4),
)
FIRST_CONNECTIONS = 3  # connecting postures that are tried first
MORE_CONNECTIONS = 3  # tried after them
MORE_IN_SCENES = 19  # likewise, in a scene for which the motions were not made
WIDER_CONNECTIONS = 12  # where none of these stands
ENTRIES_OF_EACH = 3  # of each motion among those
SECOND_ON_LEVEL, SECOND_ON_UNEVEN = 2, 6  # connecting postures from the end of a failed rollout
MORE_FINALISTS = 6  # rollouts of a round that are checked where the scene is not flat
CRAWL_FROM = 0.3  # leg lengths from a place to stand, from which a robot crawls before it rises
CRAWL_BUDGETS = 4.0  # search budgets of simulated time in which a crawl is looked for
REFITS = 3  # times that legs are fitted again to uneven ground
NEARLY_ALL = 0.9  # share of a check on flat ground from which there are no second tries
SECOND_TRIES = 2  # rounds that continue from the ends of failed rollouts
TRIES_AMONG_OBSTACLES = 4  # likewise
FINDING_BUDGETS = 20.0  # search budgets of simulated time in which a motion is looked for
STEEP, FINDING_ON_SLOPES, FINDS_ON_SLOPES = math.radians(17.5), 50.0, 3
"""Slope from which a motion is looked for at once, as stored ones tip, its budgets, and how often
if what is found does not stand."""


class FreeRise:
    """Searches for a rise by any of the stored motions.

    First the nearest connecting postures of a few motions are tried, and the cheapest rise that
    stands is taken. If none stands in enough of its disturbed rollouts, further motions and slower
    paths follow, on level ground also without the virtual actuator, on uneven ground with better
    fitted legs, in a flat scene to more entries of each motion; then the targets of the best are
    varied. What stands in fewer than `NEARLY_ALL` then is tried with less slowdown, and on new
    paths from the ends of the last rollouts; what does not stand at all, in a flat scene, along a
    motion that is found in physics from this start. On a steep slope, that is tried first.
    A rise that stands is improved by a search where the preference asks for it. If limbs are so
    interlocked that no path leaves the start, the robot is moved straight, and limbs may yield. A
    robot without room to stand crawls first: the rise has to be planned again after that.
    """

    def __init__(self, tools: SearchTools) -> None:
        self._tools, scene = tools, tools.world.scene
        self._leg = leg_length(tools.world.robot)
        # Level ground may have obstacles; a flat scene has none, and is the same everywhere.
        self._is_flat, self._is_level = scene.is_flat, scene.ground.is_level
        self._is_steep = abs(scene.slope) > STEEP
        self._second = SECOND_ON_LEVEL if self._is_level else SECOND_ON_UNEVEN
        self._finalists = FINALISTS if self._is_flat else MORE_FINALISTS

    def search(self, start: Posture, rng: np.random.Generator) -> FoundRise:
        """Search from a posture at rest; the same arguments give the same result.

        A `KeyboardInterrupt` tells what was found so far.
        """
        began = time.perf_counter()
        more = MORE_CONNECTIONS if self._is_flat else MORE_IN_SCENES
        connections = self._tools.database.select(start, FIRST_CONNECTIONS + more)
        places = self._find_standing_places(start)
        if places and places.distance(start.position) > CRAWL_FROM * self._leg:
            near, budget = CRAWL_FROM * self._leg, CRAWL_BUDGETS * self._tools.budget
            crawl = self._tools.finder.crawls.find(start, places.distance, near, budget, rng)
            if crawl is not None:
                return FoundRise(crawl=crawl, plan_s=time.perf_counter() - began)
        approach = self._tools.approach
        first = approach.candidates(start, connections[:FIRST_CONNECTIONS], rng)
        plan_s = time.perf_counter() - began
        search = RiseSearch(self._tools, start, rng)
        try:
            for _ in range(FINDS_ON_SLOPES if self._is_steep else 0):
                if not self._try_found(search, start, rng):
                    break
            if search.found.rollout is None:
                self._try_first(search, first, start, connections, rng)
                self._try_second(search, first, places, rng)
                if self._is_flat:
                    self._try_found(search, start, rng)
            search.improve()
        except KeyboardInterrupt:
            standing = self._tools.world.robot.standing_neck_height
            raise KeyboardInterrupt(
                f"planning was in round {search.found.rounds}, {search.found.describe(standing)}"
            ) from None
        planned = approach.planning and bool(first)
        return replace(search.found, planned=planned, plan_s=plan_s)

    def _try_first(
        self,
        search: RiseSearch,
        first: list[Candidate],
        start: Posture,
        connections: list[Connection],
        rng: np.random.Generator,
    ) -> None:
        """Try from the start: the first paths, further ones, and variations of targets."""
        approach, further = self._tools.approach, list[Candidate]()
        search.try_all(first)
        if not first:
            search.try_all(approach.move_straight(start, connections[:FIRST_CONNECTIONS]))
        elif not search.is_done or self._tools.filter.preference.is_demanding:
            further = approach.candidates(start, connections[FIRST_CONNECTIONS:], rng)
            if self._is_level:
                slow = [replace(c, slowdown=SLOWDOWN) for c in first + further]
                plain = self._drop_assistance(first + further)
                search.try_all(further + slow + plain, self._finalists)
            else:
                search.try_all(first + further, MORE_FINALISTS)
                search.refit(REFITS, MORE_FINALISTS)
        if first and self._is_flat and search.found.rollout is None:
            connections = self._tools.database.select(start, WIDER_CONNECTIONS, ENTRIES_OF_EACH)
            wider = approach.candidates(start, connections, rng)
            search.try_all(wider + self._drop_assistance(wider), self._finalists)
        if not search.is_done:
            search.vary()

    def _try_second(
        self,
        search: RiseSearch,
        first: list[Candidate],
        places: StandingPlaces | None,
        rng: np.random.Generator,
    ) -> None:
        """Try with less slowdown, and then from the ends of the rollouts, until one is enough."""
        if self._is_enough(search):
            return
        if search.tried:
            search.try_all([replace(c, slowdown=s) for s in OTHER_SLOWDOWNS for c in first])
        continuation = Continuation(self._tools.world, places)
        for _ in range(SECOND_TRIES if places is None else TRIES_AMONG_OBSTACLES):
            if self._is_enough(search):
                return
            candidates = self._go_on(search, continuation, rng)
            if self._is_level:
                search.try_all(candidates + self._drop_assistance(candidates))
            else:
                search.try_all(candidates, MORE_FINALISTS)
                search.refit(REFITS, MORE_FINALISTS)

    def _is_enough(self, search: RiseSearch) -> bool:
        """Tell whether a rise is good enough to leave out second tries."""
        settles = self._is_flat and not self._tools.filter.preference.is_demanding
        return search.is_done or (settles and search.stands_in(NEARLY_ALL))

    def _try_found(self, search: RiseSearch, start: Posture, rng: np.random.Generator) -> bool:
        """Find a motion in physics where no stored one leads to a stand; return whether one is."""
        if search.found.rollout is not None:
            return False
        budgets = FINDING_ON_SLOPES if self._is_steep else FINDING_BUDGETS
        found = self._tools.finder.find(start, budgets * self._tools.budget, rng)
        candidates = self._tools.approach.move_straight(start, found)
        if self._is_steep:
            candidates = [replace(c, fits=True, assistance=0.0) for c in candidates]
        search.try_all(candidates)
        if found and not (search.is_done or (self._is_steep and search.stands_in(NEARLY_ALL))):
            search.vary()
        return bool(found)

    def _go_on(
        self, search: RiseSearch, continuation: Continuation, rng: np.random.Generator
    ) -> list[Candidate]:
        """Plan from the ends of failed rollouts, each to a few motions."""
        approach, candidates = self._tools.approach, list[Candidate]()
        for end in continuation.pick(search.tried):
            near = self._tools.database.select(end.posture, self._second)
            planned = approach.candidates(end.posture, near, rng, end.target)
            candidates += planned or approach.move_straight(end.posture, near, end.target)
        return candidates

    def _drop_assistance(self, candidates: list[Candidate]) -> list[Candidate]:
        """List candidates without the virtual actuator, on flat ground.

        A motion of a weak robot may stand as it is, and fall where its center of mass is pushed.
        """
        return [replace(c, assistance=0.0) for c in candidates] if self._is_flat else []

    def _find_standing_places(self, start: Posture) -> StandingPlaces | None:
        """Find the places with room to stand; ``None`` without obstacles."""
        world = self._tools.world
        if not world.scene.obstacles:
            return None
        places = StandingPlaces(world, start.position)
        return places if places.exist else None
