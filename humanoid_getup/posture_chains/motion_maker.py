"""Makes motions of chains: shortened, judged in disturbed worlds, named by what they pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from humanoid_getup.experiments.judging.outcome import compute_share
from humanoid_getup.motions.build import NoEntryError, with_entries
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import FOUND, Motion, StartClass
from humanoid_getup.motions.optimization import (
    LIMIT_SHARES,
    MARGIN,
    UNDISTURBED,
    TrajectoryOptimizer,
    make_scenarios,
)
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.target_search import TargetSearch
from humanoid_getup.motions.trial import Trial
from humanoid_getup.posture_chains.chain_search import ChainSearch, ChainTools, SearchSettings
from humanoid_getup.posture_chains.goal import Goal, GoalExperiment
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.posture_chains.rise_kind import KindNamer
from humanoid_getup.posture_chains.shortening import WORLDS, Shortener, make_keyframes, thin
from humanoid_getup.posture_chains.ways_up import check_lifting
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import SEARCH_TIMESTEP, World
from robots import Posture, Robot, TorqueLimit
from robots.body.limbs import Limbs
from robots.kinematics import place
from robots.quaternion import Array

SHARES = (*sorted(LIMIT_SHARES), 0.85)
"""Of full torque: the least under which motions are judged; those for weak servos after it."""
KEPT_SHARE = 0.9  # of the rollouts in which a motion is judged, that must stand
WORTH = 0.3  # share from which a rise is slowed down and improved
SLOWER = (1.2, 1.5)  # factors on all times of a rise that does not stand often enough
LONG = 6.0  # s for OP3, from which it is not
VARIED, VARYING = 24, 6000.0  # worlds, and s simulated, in which rises through a goal are varied
HELD, CLOSE = 0.1, 0.02  # s after their last key, and rad by which keyframes may differ from them
JUDGED = 6  # of the ever shorter versions of a chain, at most


@dataclass(frozen=True, kw_only=True, eq=False)
class MadeMotion:
    """A motion made of a chain, and why it is not kept."""

    keyframes: Keyframes
    share: float
    """Of the rollouts of `TrajectoryOptimizer.judge` that stand; 0 if an undisturbed one falls.

    Where it is below what is kept, it may be that of the first ones alone."""
    stood: int = 0
    judged: int = 0
    """Rollouts that stood, of how many: of the first ones alone, where so many of these fell."""
    motion: Motion | None = None
    """None where it is not kept."""
    failure: str = ""
    """Why it is not kept."""

    @property
    def duration(self) -> float:
        """Return the time from the first key to the last [s]."""
        return float(self.keyframes.duration.sum())

    def refuse(self, failure: str) -> MadeMotion:
        """Return it without the motion."""
        return replace(self, motion=None, failure=failure)


def list_shares(robot: Robot, limit: TorqueLimit) -> list[float]:
    """List the torques under which motions may be judged at least, as shares of a torque limit."""
    full = float(robot.max_torque.max())
    return [
        share if limit.value is None else min(share * full / limit.value, 1.0) for share in SHARES
    ]


class MotionMaker:
    """Makes motions of chains of one robot in one world, under one torque limit."""

    def __init__(
        self,
        world: World,
        *,
        seed: int,
        limit: TorqueLimit,
        weakest: float,
        goal: Goal | None = None,
        threads: int = 0,
    ) -> None:
        """Prepare; disturbances are drawn from the seed, alike for all chains.

        Motions are judged at no less than the ``weakest`` share of the limit, and have to come to a
        goal on the way, if one is given.
        """
        self._goal = goal or Goal(world)
        self._world, self._seed, self._limit, self._threads = world, seed, limit, threads
        full = float(world.robot.max_torque.max())
        self._torque = full if limit.value is None else limit.value
        self._bounds = (weakest * self._torque, self._torque)
        self._namer = KindNamer(world)
        self.simulated = 0.0
        """Time simulated so far [s]."""

    def make(
        self,
        chain: PostureChain,
        rest: float,
        *,
        name: str,
        start_class: StartClass,
        improves: bool = True,
    ) -> MadeMotion:
        """Make a motion of a chain, whose moves are followed by a rest [s].

        The shortest of its versions that stands often enough is kept; motions end standing also
        when they are entered at rest at some of their frames. If none does, the best one is slowed
        down; then a short one may be improved, and one through a goal is varied.
        """
        world, rng = self._world, np.random.default_rng([self._seed, 0])
        keyframes = make_keyframes(
            chain, world.robot, name=name, start_class=start_class, rest=rest
        )
        keyframes = replace(keyframes, torque_limit=self._torque)
        scenarios = make_scenarios(
            world, chain.start, self._torque, WORLDS, MARGIN, rng, bounds=self._bounds
        )
        shortener = Shortener(world, scenarios, goal=self._goal, threads=self._threads)
        optimizer = TrajectoryOptimizer(
            world, chain.start, threads=self._threads, bounds=self._bounds
        )
        versions = shortener.shorten(keyframes)
        found = choose_version(versions, lambda each: self._judge(each, optimizer))
        if WORTH <= found.share < KEPT_SHARE:
            found = self._slow_down(found, optimizer)
        is_worth_it = WORTH <= found.share < KEPT_SHARE
        if is_worth_it and not self._goal.is_stand:
            found = self._vary(found, optimizer)
        elif improves and is_worth_it and found.duration < LONG * shortener.scale:
            better = self._judge(optimizer.improve(found.keyframes, self._seed), optimizer)
            found = max(found, better, key=lambda each: each.share)
        self.simulated += shortener.simulated + optimizer.simulated
        if found.share >= KEPT_SHARE:
            return self._record(found, chain.start)
        if not found.share:
            return found.refuse("it falls undisturbed")
        return found.refuse(
            f"stands in {found.stood} of {found.judged} rollouts, expected {KEPT_SHARE:.0%}"
        )

    def _slow_down(self, found: MadeMotion, optimizer: TrajectoryOptimizer) -> MadeMotion:
        """Return the best of a rise and slower ones: weak servos fall behind less there."""
        judged = [found]
        for pace in SLOWER:
            slower = replace(found.keyframes, duration=pace * found.keyframes.duration)
            judged.append(self._judge(slower, optimizer))
            if judged[-1].share >= KEPT_SHARE:
                break
        return max(judged, key=lambda each: each.share)

    def _vary(self, found: MadeMotion, optimizer: TrajectoryOptimizer) -> MadeMotion:
        """Return the better of a rise and what varying it in disturbed worlds finds."""
        world, keyframes, rng = self._world, found.keyframes, np.random.default_rng([self._seed, 3])
        scenarios = optimizer.make_scenarios(keyframes, VARIED, rng)
        coarse = world.vary(timestep=world.robot.choose_timestep(SEARCH_TIMESTEP))
        search = TargetSearch(coarse, preference=Preference(time=1.0))
        search.experiment = GoalExperiment(self._goal, coarse, threads=self._threads)
        varied = search.search(scenarios, keyframes.targets(world.robot, HELD), VARYING, rng)
        self.simulated += varied.simulated
        duration = np.full(len(varied.target) - 1, world.robot.control_period)
        dense = replace(keyframes, keys=varied.target, duration=duration)
        better = self._judge(thin(dense, CLOSE), optimizer)
        return max(found, better, key=lambda each: each.share)

    def _judge(self, keyframes: Keyframes, optimizer: TrajectoryOptimizer) -> MadeMotion:
        """Judge keyframes with the time that the servos need."""
        keyframes = keyframes.stretch(self._world.robot)
        stood = optimizer.judge(keyframes, self._seed, least=KEPT_SHARE)[1]
        share = compute_share(stood, UNDISTURBED)
        return MadeMotion(
            keyframes=keyframes, share=share, stood=int(stood.sum()), judged=len(stood)
        )

    def _record(self, found: MadeMotion, start: Array) -> MadeMotion:
        """Record a sound version as a motion."""
        world = self._world
        trial = Trial.of(world, found.keyframes, start, self._limit)
        if not trial.succeeded:
            return replace(found, failure=f"undisturbed, it {trial.describe()}")
        if not self._goal.is_passed(trial.outcome.record):
            return replace(found, failure="it no longer comes to the key posture")
        strategy = self._namer.name_strategy(trial)
        keyframes = replace(found.keyframes, strategy=strategy)
        motion = replace(trial.record(self._describe(found)), strategy=strategy)
        try:
            motion = with_entries(world, motion, self._limit)
        except NoEntryError as error:
            return replace(found, failure=str(error))
        return replace(found, keyframes=keyframes, motion=motion, failure="")

    def _describe(self, found: MadeMotion) -> dict[str, str | float | int]:
        return {
            "program": "getup motions discover",
            "seed": self._seed,
            "disturbed_success": found.share,
            "torque_limit": self._torque,
            "least_torque": self._bounds[0],
        }


def choose_version(
    versions: Sequence[Keyframes], judge: Callable[[Keyframes], MadeMotion]
) -> MadeMotion:
    """Choose the shortest version found that stands often enough; the best where none does.

    Versions are in the order in which they were shortened: the later, the more often they fall, so
    they are bisected after the last one.
    """
    judged, kept, fallen = list[MadeMotion](), -1, len(versions)
    while len(judged) < JUDGED and fallen - kept > 1:
        row = (kept + fallen) // 2 if judged else fallen - 1
        judged.append(judge(versions[row]))
        if judged[-1].share >= KEPT_SHARE:
            kept = row
        else:
            fallen = row
    sound = [each for each in judged if each.share >= KEPT_SHARE]
    return sound[-1] if sound else max(judged, key=lambda each: each.share)


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
        search.is_hard = bool(self._world.scene.slope)
        found = list[Motion]()
        while not found and known + tools.player.simulated < budget:
            search.advance()
            self._monitor.show(
                Progress(
                    phase="searching a motion in physics [s simulated]",
                    done=min(budget, known + tools.player.simulated),
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
        if not self._world.scene.slope:  # on which they do not lead to its stance
            tools.ways_up.add_motions(self._known, settings.batch)
        return tools

    def _make(
        self, chain: PostureChain, start_class: StartClass, rest: float, rng: np.random.Generator
    ) -> list[Motion]:
        """Make motions of versions of a chain that stand; on a slope, of the chain as it is."""
        self._monitor.begin("shortening a chain of postures that stands")
        scenarios = MARGIN.sample(self._world, chain.start, WORLDS, rng, self._limit)
        shortener = Shortener(
            self._world, scenarios, threads=self._threads, check=self._monitor.check
        )
        keyframes = make_keyframes(
            chain, self._world.robot, name=FOUND, start_class=start_class, rest=rest
        )
        if self._world.scene.slope:
            keys = np.vstack([keyframes.keys[:-1], chain.moves[-1].target])
            versions = [replace(keyframes, keys=keys)]
        else:
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
        moves = RandomMoves(world.robot, np.random.default_rng(0), world.scene.footing)
    except ValueError:
        return None
    is_weak = check_lifting(world, moves, limit) is not None
    return None if is_weak else moves
