"""A search for a rise: rounds of candidates, rolled out, checked and varied."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.filtering.candidate import Candidate, CandidateRollout
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.motions.motion_database import Connection, MotionDatabase
from humanoid_getup.simulation.standing_places import StandingPlaces
from humanoid_getup.strategies.approach import Approach
from humanoid_getup.strategies.continuation import Continuation, End
from humanoid_getup.strategies.crawl import Crawl, Move
from robots import Posture

ENOUGH = 1.0  # share of the disturbed rollouts that must stand to stop searching
FINALISTS = 3  # rollouts of a round that may be checked
CRAWLS = 2  # searches for a move that leads nearer to room
SEARCH_STARTS = 2  # failed rollouts that a search begins with, where none stood


@dataclass(frozen=True, kw_only=True)
class SearchTools:
    """What a search for a rise uses, in one scene."""

    database: MotionDatabase
    approach: Approach
    filter: DynamicsFilter
    assistance: float
    """Share of the virtual actuator's torques."""
    budget: float
    """Simulated time in which a search may vary a rollout's targets [s]."""


class RiseSearch:
    """Searches for a rise from one start, and keeps the best one."""

    def __init__(self, tools: SearchTools, start: Posture, rng: np.random.Generator) -> None:
        self._tools, self._filter = tools, tools.filter
        self.start, self._rng = start, rng
        self.tried: list[CandidateRollout] = []
        """Rollouts of the last round."""
        self.best: CandidateRollout | None = None
        self.before: CandidateRollout | None = None
        """The rise that was improved."""
        self.robust = float("nan")
        """Share of the disturbed rollouts in which the best one stood."""
        self.rounds = 0
        self.planned = False
        """Whether any path was planned."""
        self.highest = 0.0
        """Greatest height of the neck in any rollout [m]."""

    @property
    def is_done(self) -> bool:
        """Return whether there is a rise that stands under every disturbance."""
        return self.best is not None and self.robust >= ENOUGH

    def plan(self, connections: list[Connection], end: End | None = None) -> list[Candidate]:
        """Plan paths to connecting postures, and return the candidates that have one.

        The paths begin at the end of an earlier rollout, or else where the robot lies.
        """
        approach = self._tools.approach
        if end is not None:
            return approach.candidates(end.posture, connections, self._rng, end.target)
        candidates = approach.candidates(self.start, connections, self._rng)
        self.planned |= approach.planning and bool(candidates)
        return candidates

    def pull_free(self, connections: list[Connection], end: End | None = None) -> list[Candidate]:
        """Move straight and slowly to connecting postures, without a path: limbs may yield."""
        approach = self._tools.approach
        if end is not None:
            return approach.pull_free(end.posture, connections, end.target)
        return approach.pull_free(self.start, connections)

    def try_all(self, candidates: list[Candidate], finalists: int = FINALISTS) -> None:
        """Roll candidates out; check the cheapest that stood against disturbances."""
        if not candidates:
            return
        self.rounds += 1
        candidates = [replace(c, assistance=self._tools.assistance) for c in candidates]
        self.tried = self._filter.roll_out(self.start, candidates)
        self.highest = max(self.highest, *(r.peak_neck for r in self.tried))
        standing = sorted((r for r in self.tried if r.stood), key=lambda r: r.cost)
        for finalist in standing[:finalists]:
            self._check(finalist)
            if self.best and self.is_done and not self.best.collides:
                return

    def refit(self, times: int, finalists: int) -> None:
        """Fit the legs of the last round's candidates to where their rollouts came, and try again.

        Where the ground is uneven, a robot that came to another place or heading than its
        motion would on level ground needs another fit.
        """
        for _ in range(times):
            if self.is_done:
                return
            self.try_all([self._filter.follow(r) for r in self.tried], finalists)

    def vary(self) -> None:
        """Vary the targets of the best rollout, or of the failed ones that rose highest."""
        failed = sorted(self.tried, key=lambda r: -r.peak_neck)[:SEARCH_STARTS]
        for base in [self.best] if self.best else failed:
            better, share = self._filter.search(self.start, base, self._tools.budget, self._rng)
            if better.stood and share > (self.robust if self.best else 0.0):
                self.best, self.robust = better, share
                if better.collides:
                    self._check(better)
                if self.is_done:
                    return

    def improve(self) -> None:
        """Vary the targets of a rise that stands everywhere, where more is preferred."""
        best, preference = self.best, self._filter.preference
        if best and self.is_done and (preference.is_demanding or best.collides):
            budget = preference.improvement * self._tools.budget
            better = self._filter.improve(self.start, best, budget, self._rng)
            if better is not best:
                self.best, self.before = better, best

    def crawl(self, crawl: Crawl, places: StandingPlaces) -> Move | None:
        """Find a move towards where the robot has room to stand; ``None`` if none leads nearer."""
        distance = float(places.distance(self.start.position))
        for _ in range(CRAWLS):
            move = crawl.search(self.start, places.distance, self._rng)
            if move is not None and move.cost < distance:
                return move
        return None

    def go_on(
        self, continuation: Continuation, connect: int = 2, finalists: int = FINALISTS
    ) -> None:
        """Continue from the ends of failed rollouts, each with so many motions to join."""
        candidates = []
        for end in continuation.pick(self.tried):
            connections = self._tools.database.select(end.posture, connect)
            candidates += self.plan(connections, end) or self.pull_free(connections, end)
        self.try_all(candidates, finalists)

    def _check(self, rollout: CandidateRollout) -> None:
        """Check a rollout that stands, its touching limbs parted; keep it if it is the best."""
        parted = self._filter.separate(self.start, rollout)
        for one in [parted] if parted is rollout else [parted, rollout]:
            best = self.best
            if best and self.is_done and one.cost >= best.cost:
                return
            share = self._filter.check(self.start, one.target, self._rng)
            known = (self.robust, -best.cost) if best else (0.0, 0.0)
            if share > 0.0 and (share, -one.cost) > known:
                self.best, self.robust = one, share
