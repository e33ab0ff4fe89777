"""A search for a rise: candidates from one start are rolled out, checked, varied and improved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.filtering.candidate import Candidate, CandidateRollout
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import Approach, MotionFinder
from humanoid_getup.strategies.plan import KeyRecord
from robots import Posture

if TYPE_CHECKING:
    from humanoid_getup.posture_chains.crawl_search import Crawl

FINALISTS = 3  # rollouts of a round that may be checked
SEARCH_STARTS = 2  # failed rollouts that a search begins with, where none stood


@dataclass(frozen=True, kw_only=True)
class SearchTools:
    """Tools shared by the searches for rises of one robot in one scene."""

    world: World
    database: MotionDatabase
    approach: Approach
    filter: DynamicsFilter
    finder: MotionFinder
    budget: float
    """Simulated time in which a search may vary a rollout's targets [s]."""
    monitor: ProgressMonitor = field(default_factory=ProgressMonitor)
    """Shows the steps, and ends the search between two of them if it is canceled."""

    def reset_counts(self) -> None:
        """Count rollouts and simulated time from 0, for a new plan.

        The difference of two running totals would be rounded by the plans before.
        """
        self.filter.count, self.filter.searched = 0, 0.0
        self.finder.reset_count()

    @property
    def searched(self) -> float:
        """Return the time that searches have simulated for this plan [s]."""
        return self.filter.searched + self.finder.simulated


@dataclass(kw_only=True)
class FoundRise:
    """Result of a search from a start."""

    rollout: CandidateRollout | None = None
    """The best rise; None if nothing stands."""
    before: CandidateRollout | None = None
    """The rise that was improved; None if none was."""
    robust: float = float("nan")
    """Share of the disturbed rollouts in which the best one stood."""
    crawl: Crawl | None = None
    """A crawl to a place with room, instead of a rise."""
    keys: tuple[KeyRecord, ...] = ()
    """Result of each key posture, in the given order."""
    planned: bool = False
    """Whether any path was planned."""
    rolled_out: bool = False
    """Whether anything was rolled out."""
    highest: float = 0.0
    """Greatest height of the neck in any rollout [m]."""
    rounds: int = 0
    plan_s: float = 0.0
    """Wall time of selection and planning before the first rollout [s]."""
    joined: str = ""
    """Name of the motion along which the neck rose highest; empty if nothing was rolled out."""

    def describe(self, standing: float) -> str:
        """Describe the best rise so far, for a neck height in the stance [m]."""
        if self.rollout is not None:
            name = self.rollout.candidate.connection.motion.name
            return f"the best, along {name}, stands in {self.robust:.0%} of its disturbed rollouts"
        if not self.joined:
            return "nothing was rolled out yet"
        share = self.highest / standing
        return f"none stands yet; the best, along {self.joined}, raised the neck to {share:.0%}"


class RiseSearch:
    """Searches for a rise from one start, and keeps the best one.

    The best loses the fewest key postures, stands under the most disturbances, and costs least, in
    this order.
    """

    def __init__(
        self,
        tools: SearchTools,
        start: Posture,
        rng: np.random.Generator,
        count_lost: Callable[[CandidateRollout], int] = lambda _: 0,
    ) -> None:
        """Prepare to search; ``count_lost`` counts the key postures that a rollout misses."""
        self._tools, self._filter, self._count_lost = tools, tools.filter, count_lost
        self._start, self._rng = start, rng
        self.tried: list[CandidateRollout] = []
        """Rollouts of the last round."""
        self.found = FoundRise()
        """The result so far."""

    @property
    def is_done(self) -> bool:
        """Return whether there is a rise that stands under enough disturbances."""
        return self.stands_in(self._filter.enough)

    def stands_in(self, share: float) -> bool:
        """Tell whether there is a rise that stands in a share of its disturbed rollouts."""
        return self.found.rollout is not None and self.found.robust >= share

    def roll_out(self, candidates: list[Candidate]) -> list[CandidateRollout]:
        """Roll candidates out, as a round."""
        found = self.found
        found.rounds, found.rolled_out = found.rounds + 1, True
        self.tried = self._filter.roll_out(self._start, candidates)
        highest = max(self.tried, key=lambda one: one.peak_neck)
        if highest.peak_neck > found.highest:
            found.highest = highest.peak_neck
            found.joined = highest.candidate.connection.motion.name
        return self.tried

    def try_all(self, candidates: list[Candidate], finalists: int = FINALISTS) -> None:
        """Roll candidates out, and check the best of those that stood."""
        if candidates:
            self.check_all([r for r in self.roll_out(candidates) if r.stood], finalists)

    def check_all(self, standing: list[CandidateRollout], finalists: int) -> None:
        """Check the best of some rollouts that stand against disturbances."""
        for finalist in sorted(standing, key=self._rank)[:finalists]:
            self._check(finalist)
            best = self.found.rollout
            if best and self.is_done and not best.collides:
                return

    def refit(self, times: int, finalists: int) -> None:
        """Fit the legs of the last candidates to the places of their rollouts, and try again.

        Where the ground is uneven, a robot that came to another place or heading than its
        motion would on level ground needs another fit.
        """
        for _ in range(times):
            if self.is_done:
                return
            self.try_all([self._filter.fit_legs(r) for r in self.tried], finalists)

    def vary(self) -> None:
        """Vary the targets of the best rollout, or of the failed ones that rose highest."""
        rose = [one for one in self.tried if one.peak_neck >= self._filter.hopeless]
        failed = sorted(rose, key=lambda r: -r.peak_neck)[:SEARCH_STARTS]
        found = self.found
        for base in [found.rollout] if found.rollout else failed:
            better, share = self._filter.search(self._start, base, self._tools.budget, self._rng)
            if self._replaces_best(better) and share > (found.robust if found.rollout else 0.0):
                found.rollout, found.robust = better, share
                if better.collides:
                    self._check(better)
                if self.is_done:
                    return

    def improve(self) -> None:
        """Vary the targets of a rise that stands everywhere, if the preference requires it."""
        best, preference = self.found.rollout, self._filter.preference
        if best and self.is_done and (preference.is_demanding or best.collides):
            budget = preference.improvement * self._tools.budget
            better = self._filter.improve(self._start, best, budget, self._rng)
            if better is not best and self._replaces_best(better):
                self.found.rollout, self.found.before = better, best

    def _replaces_best(self, rollout: CandidateRollout) -> bool:
        """Return whether a rollout stands, and loses no key posture that the best one has."""
        best = self.found.rollout
        is_worse = best and self._count_lost(rollout) > self._count_lost(best)
        return rollout.stood and not is_worse

    def _rank(self, rollout: CandidateRollout) -> tuple[int, float]:
        """Return the sort key of a rollout, smallest for the best."""
        return self._count_lost(rollout), rollout.cost

    def _check(self, rollout: CandidateRollout) -> None:
        """Check a rollout that stands, with limbs separated; keep it if it is the best."""
        budget = self._filter.preference.improvement * self._tools.budget
        separated = self._filter.separate(self._start, rollout, budget)
        for one in [separated] if separated is rollout else [separated, rollout]:
            found, (lost, cost) = self.found, self._rank(one)
            best = found.rollout
            if best and self.is_done and (lost, cost) >= self._rank(best):
                return
            known = (-self._count_lost(best), found.robust, -best.cost) if best else None
            least = found.robust if known and -lost <= known[0] else 0.0
            share = self._filter.check(self._start, one.target, self._rng, least=least)
            if share > 0.0 and (known is None or (-lost, share, -cost) > known):
                found.rollout, found.robust = self._filter.confirm(self._start, one), share
