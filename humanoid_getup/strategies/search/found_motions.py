"""Found motions: rises from one start that are found in physics, where no stored one helps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from humanoid_getup.motions.motion import Motion, StartClass
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.optimization import MARGIN
from humanoid_getup.motions.trial import Trial
from humanoid_getup.posture_chains.chain_keyframes import FOUND, make_keyframes
from humanoid_getup.posture_chains.chain_search import ChainSearch, ChainTools, SearchSettings
from humanoid_getup.posture_chains.lifting import check_lifting
from humanoid_getup.posture_chains.motion_maker import name_strategy
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.posture_chains.rise_kind import KindNamer
from humanoid_getup.posture_chains.shortening import WORLDS, Shortener
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit
from robots.body.limbs import Limbs
from robots.kinematics import place

MOST_CHAINS, MOST_VERSIONS = 2, 3  # shortest chains, and versions of each, that become motions


class MotionFinder:
    """Finds motions from one start, by a search over resting postures.

    An addition to [Lin12], whose rises join motions of a database.
    """

    def __init__(self, world: World, torque_limit: TorqueLimit, *, threads: int = 0) -> None:
        """Prepare for a world without obstacles, and for a torque limit."""
        self._world, self._limit, self._threads = world, torque_limit, threads
        self.simulated = 0.0
        """Time simulated so far [s]."""

    def find(
        self, start: Posture, start_class: StartClass, budget: float, rng: np.random.Generator
    ) -> list[Connection]:
        """Find motions from a posture at rest, to be joined at their first frames.

        There is none if no chain of postures to a stand is found in a simulated time [s], or if
        the robot has no two legs with a knee, or servos that do not lift it.
        """
        try:
            Limbs(self._world.robot)
        except ValueError:
            return []
        settings = SearchSettings(limit=self._limit, threads=self._threads)
        tools = ChainTools(self._world, rng, settings)
        if check_lifting(self._world, tools.moves, tools.player.scale, self._limit) is not None:
            return []
        search = ChainSearch(tools, place(self._world.robot, self._world.model, start))
        while not search.chains and tools.player.simulated < budget:
            search.advance()
        self.simulated += tools.player.simulated
        found = list[Connection]()
        for chain in search.chains[:MOST_CHAINS]:
            found += self._make_motions(chain, start_class, tools.player.rest, rng)
        return found

    def _make_motions(
        self, chain: PostureChain, start_class: StartClass, rest: float, rng: np.random.Generator
    ) -> list[Connection]:
        """Make motions of ever shorter versions of a chain that stand, the shortest first."""
        scenarios = MARGIN.sample(self._world, chain.start, WORLDS, rng, self._limit)
        shortener = Shortener(self._world, scenarios, threads=self._threads)
        keyframes = make_keyframes(
            chain, self._world.robot, name=FOUND, start_class=start_class, rest=rest
        )
        versions = shortener.shorten(keyframes)
        self.simulated += shortener.simulated
        rows = np.unique(np.linspace(0, len(versions) - 1, MOST_VERSIONS).round().astype(int))
        trials = [
            Trial.of(
                self._world, versions[row].stretch(self._world.robot), chain.start, self._limit
            )
            for row in rows[::-1]
        ]
        return [Connection(self._record(trial), 0, 0.0) for trial in trials if trial.succeeded]

    def _record(self, trial: Trial) -> Motion:
        strategy = name_strategy(KindNamer(self._world), trial)
        return replace(trial.record({}), strategy=strategy)
