"""Motions from one start: a search over resting postures where a robot lies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from humanoid_getup.motions.motion import FOUND, Motion, StartClass
from humanoid_getup.motions.optimization import MARGIN
from humanoid_getup.motions.trial import Trial
from humanoid_getup.posture_chains.chain_keyframes import make_keyframes
from humanoid_getup.posture_chains.chain_search import ChainSearch, ChainTools, SearchSettings
from humanoid_getup.posture_chains.lifting import check_lifting
from humanoid_getup.posture_chains.move_player import measure_time_scale
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.posture_chains.rise_kind import KindNamer
from humanoid_getup.posture_chains.shortening import WORLDS, Shortener
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit
from robots.body.limbs import Limbs
from robots.kinematics import place

MOST_VERSIONS = 3  # of a chain, that become motions


class StartMotions:
    """Finds motions of one robot from where it lies, in a world without obstacles."""

    def __init__(
        self,
        world: World,
        limit: TorqueLimit,
        known: Sequence[Motion] = (),
        *,
        threads: int = 0,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        """Prepare for a torque limit, and for known motions, which may be joined on the way."""
        self._world, self._limit, self._threads = world, limit, threads
        self._known, self._monitor = known, monitor or ProgressMonitor()
        self.simulated = 0.0
        """Time simulated for this plan [s]."""

    def find(
        self, start: Posture, start_class: StartClass, budget: float, rng: np.random.Generator
    ) -> list[Motion]:
        """Find motions from a posture at rest: ever shorter versions of one, the shortest first.

        There is none if the search finds none in a simulated time [s], or if the robot has no two
        legs with a knee, or servos that do not lift it. The ways up to begin with are made once,
        but their time is counted for every start, so that no result depends on earlier ones.
        """
        if self._tools is None:
            return []
        tools, known = self._tools.copy(rng), self._tools.player.simulated
        search = ChainSearch(tools, place(self._world.robot, self._world.model, start))
        found = list[Motion]()
        while not found and known + tools.player.simulated < budget:
            search.advance()
            self._monitor.show(
                Progress(
                    phase="searching chains of postures [s simulated]",
                    done=known + tools.player.simulated,
                    total=budget,
                    note=f"{len(search.archive)} states",
                )
            )
            if search.untried:
                chain = search.shorten(search.untried.pop(0))
                found = self._make(chain, start_class, tools.player.rest, rng)
        self.simulated += known + tools.player.simulated
        return found

    @cached_property
    def _tools(self) -> ChainTools | None:
        """Make what searches from all starts begin with; None if the robot cannot be lifted."""
        self._monitor.begin("searching ways up to the stance in physics")
        moves = _make_moves(self._world, self._limit)
        if moves is None:
            return None
        settings = SearchSettings(limit=self._limit, threads=self._threads)
        tools = ChainTools(self._world, np.random.default_rng(0), settings, moves)
        tools.ways_up.add_motions(self._known, settings.batch)
        return tools

    def _make(
        self, chain: PostureChain, start_class: StartClass, rest: float, rng: np.random.Generator
    ) -> list[Motion]:
        """Make motions of versions of a chain that stand."""
        self._monitor.begin("shortening a chain of postures that stands")
        scenarios = MARGIN.sample(self._world, chain.start, WORLDS, rng, self._limit)
        shortener = Shortener(
            self._world, scenarios, threads=self._threads, check=self._monitor.check
        )
        keyframes = make_keyframes(
            chain, self._world.robot, name=FOUND, start_class=start_class, rest=rest
        )
        versions = shortener.shorten(keyframes)
        self.simulated += shortener.simulated
        rows = np.unique(np.linspace(0, len(versions) - 1, MOST_VERSIONS).round().astype(int))
        some = [versions[row].stretch(self._world.robot) for row in rows[::-1]]
        trials = [Trial.of(self._world, each, chain.start, self._limit) for each in some]
        return [self._record(trial) for trial in trials if trial.succeeded]

    def _record(self, trial: Trial) -> Motion:
        strategy = KindNamer(self._world).name_strategy(trial)
        return replace(trial.record({}), strategy=strategy)


def _make_moves(world: World, limit: TorqueLimit) -> RandomMoves | None:
    """Make the moves of a robot; None if it has no two legs with a knee, or is too weak."""
    try:
        Limbs(world.robot)
    except ValueError:
        return None
    moves = RandomMoves(world.robot, np.random.default_rng(0))
    is_weak = check_lifting(world, moves, measure_time_scale(world.robot), limit) is not None
    return None if is_weak else moves
