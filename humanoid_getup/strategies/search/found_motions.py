"""Found motions: rises and crawls from one start that are found in physics."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.starts.falls import find_side
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit

if TYPE_CHECKING:  # a rise that joins a stored motion does not wait for their imports
    from humanoid_getup.posture_chains.crawl_search import CrawlSearch
    from humanoid_getup.posture_chains.motion_maker import StartMotions


class MotionFinder:
    """Finds motions to join from one start, and crawls, by searches over resting postures.

    An addition to [Lin12], whose rises join motions of a database.
    """

    def __init__(
        self,
        world: World,
        torque_limit: TorqueLimit,
        known: Sequence[Motion] = (),
        *,
        threads: int = 0,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        self._world, self._limit = world, torque_limit
        self._known = known
        self._threads, self._monitor = threads, monitor
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
            self._limit,
            CHECK_DISTURBANCE,
            threads=self._threads,
            monitor=self._monitor,
        )
        self._begun.append(search)
        return search

    @cached_property
    def _search(self) -> StartMotions:
        from humanoid_getup.posture_chains.motion_maker import StartMotions

        search = StartMotions(
            self._world, self._limit, self._known, threads=self._threads, monitor=self._monitor
        )
        self._begun.append(search)
        return search
