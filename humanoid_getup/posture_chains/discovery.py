"""Discovery: searches chains from each side, and makes motions of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.motions.build import lay_on_side
from humanoid_getup.motions.motion import FOUND, Motion
from humanoid_getup.motions.motion_database import KeyPosture, label_key, list_sides
from humanoid_getup.posture_chains.chain_search import (
    TURNS,
    ChainSearch,
    ChainTools,
    SearchSettings,
)
from humanoid_getup.posture_chains.key_goal import find_key_goal
from humanoid_getup.posture_chains.motion_maker import MadeMotion, MotionMaker, list_shares
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.posture_chains.rise_kind import are_same, sample_way
from humanoid_getup.posture_chains.ways_up import find_least_share
from humanoid_getup.simulation.world import World

SYMMETRIC = ("supine", "prone")  # sides from which a mirrored motion rises as well
FURTHER_SHARE = 1.0  # of the time until a side's first motion, for further ones
LATE, EXTRA_TURNS = 30_000.0, 3  # s simulated without a chain, and turns of the side ahead then
HARD = 10_000.0  # s of a side's own search without a chain, from which its moves are checked less
WAITING = 1.3  # times a side's time until its first chain, or its last motion, before the next
LONGEST_WAIT = 4000.0  # s simulated, at most, from these to the next
UNIMPROVED = 20_000.0  # s of the search, before which another chain is found sooner
MAKING_SHARE = 1.0  # of the time of the search, above which motions are not improved
MOST_REPEATS = 2  # motions of one way, after which no other way is searched
LEAST_FURTHER = 2000.0  # s simulated, for further ones

Accept = Callable[[Motion], str]
"""Returns why a motion cannot be kept; "" if it can."""
Announce = Callable[["SideSearch"], None]
"""Is called with a side before a motion of its chain is made, which may take minutes."""


@dataclass(eq=False)
class SideSearch:
    """The search from one side, and what came of it."""

    side: LyingSide
    search: ChainSearch
    kept: list[Motion] = field(default_factory=list)
    tried: int = 0
    """Chains of which a motion was tried."""
    spent: float = 0.0
    """Simulated time of its own batches [s]."""
    repeats: int = 0
    """Motions that took the way of another one."""
    ready: float = math.inf
    """That time from which the next motion is made [s]."""
    first: float = math.inf
    """That time when its first motion was kept [s]."""

    def is_done(self, most: int) -> bool:
        """Tell whether it has so many motions, or one and nothing else in sight."""
        further = max(FURTHER_SHARE * self.first, LEAST_FURTHER)
        has_ended = self.spent > self.first + further or self.repeats >= MOST_REPEATS
        return len(self.kept) >= most or (bool(self.kept) and has_ended)

    def take_chain(self, *, waits: bool = True) -> PostureChain | None:
        """Take the best chain of which no motion was tried yet, if it is time for one.

        After the first one that is found, and after every motion, better ones have some time to be
        found: chains that are known together are often alike, and motions of them fail alike.
        """
        if not self.search.untried:
            return None
        self.ready = min(self.ready, self._next_ready)
        if waits and self.spent < self.ready:
            return None
        self.tried, self.ready = self.tried + 1, self._next_ready
        return self.search.untried.pop(0)

    @property
    def _next_ready(self) -> float:
        return min(WAITING * self.spent, self.spent + LONGEST_WAIT)


class ChainDiscovery:
    """Finds motions of one robot in one world by a search over resting postures."""

    def __init__(
        self,
        world: World,
        *,
        seed: int,
        sides: tuple[LyingSide, ...] | None = None,
        most: int = 2,
        settings: SearchSettings | None = None,
        through: KeyPosture | None = None,
        accept: Accept = lambda _: "",
        announce: Announce = lambda _: None,
    ) -> None:
        """Prepare to find up to ``most`` motions from each side, by default all, of other ways.

        They lead ``through`` a key posture, if one is given.

        Raises:
            ValueError: if the robot does not rest in that posture, or get up from it.
        """
        sides = list_sides(world.robot) if sides is None else sides
        settings = settings or SearchSettings()
        rng, limit = np.random.default_rng(seed), settings.limit
        moves, shares = RandomMoves(world.robot, rng), list_shares(world.robot, limit)
        self.least_share = find_least_share(world, moves, limit, shares)
        """Share of the torque limit under which motions are judged at least."""
        self.is_weak = self.least_share > shares[0]
        """Whether the usual share does not lift the robot."""
        settings = replace(settings, weakest=self.least_share)
        self.tools = ChainTools(world, rng, settings, moves)
        if through is not None:
            goal = find_key_goal(self.tools, through)
            self.tools = ChainTools(world, rng, settings, moves, goal)
        self._label = FOUND if through is None else label_key(through.name)
        self.maker = MotionMaker(
            world,
            seed=seed,
            limit=limit,
            weakest=self.least_share,
            goal=self.tools.goal,
            threads=settings.threads,
        )
        self._world, self._most = world, most
        self._accept, self._announce = accept, announce
        starts = [lay_on_side(world, side, self.tools.rng) for side in sides]
        self.sides = [
            SideSearch(side, ChainSearch(self.tools, start))
            for side, start in zip(sides, starts, strict=True)
            if start is not None
        ]
        searched = {each.side for each in self.sides}
        self.skipped = tuple(side for side in sides if side not in searched)
        """Sides on which the robot does not stay."""

    @property
    def simulated(self) -> float:
        """Return the time simulated so far [s]."""
        return self.tools.player.simulated + self.maker.simulated

    @property
    def is_done(self) -> bool:
        """Tell whether nothing is left to search."""
        return all(each.is_done(self._most) for each in self.sides)

    def advance(self) -> Iterator[tuple[SideSearch, MadeMotion]]:
        """Search from each side that is not done for one round; yield the motions tried."""
        for each in self._list_turns():
            before = self.simulated
            each.search.is_hard = not each.search.chains and each.spent > HARD
            for _ in TURNS:
                each.search.advance()
            each.spent += self.simulated - before
            if chain := each.take_chain():
                yield each, self._try(each, chain, improves=self._has_time_to_improve)

    def conclude(self) -> Iterator[tuple[SideSearch, MadeMotion]]:
        """Try a chain of each side without a motion, where the search ends; yield the motions.

        They are not improved, which may take longer than the search.
        """
        for each in self.sides:
            if not each.kept and (chain := each.take_chain(waits=False)):
                yield each, self._try(each, chain, improves=False)

    @property
    def _has_time_to_improve(self) -> bool:
        searched = self.tools.player.simulated
        return searched > UNIMPROVED and self.maker.simulated < MAKING_SHARE * searched

    def _list_turns(self) -> list[SideSearch]:
        """List the sides to search next; without a chain for long, mostly the one that is ahead."""
        going = [each for each in self.sides if not each.is_done(self._most)]
        is_hard = self.simulated > LATE and not any(each.search.chains for each in self.sides)
        if not is_hard:
            return going
        ahead = max(going, key=lambda each: each.search.archive.best.progress)
        return [*going, *[ahead] * EXTRA_TURNS]

    def _try(self, each: SideSearch, chain: PostureChain, *, improves: bool) -> MadeMotion:
        """Make a motion of a chain; keep it if it can be, as a way up for the other sides."""
        self._announce(each)
        name = f"{each.side}_{self._label}_{len(each.kept) + 1}"
        chain, rest = each.search.shorten(chain), self.tools.player.rest
        chain = replace(chain, moves=chain.moves + self.tools.goal.onward)
        made = self.maker.make(chain, rest, name=name, start_class=each.side, improves=improves)
        made = self._check(each, made)
        if made.motion is not None:
            each.kept.append(made.motion)
            each.first = min(each.first, each.spent)
            if self.tools.goal.is_stand:
                both = [made.motion, made.motion.mirrored(self._world.robot)]
                self.tools.ways_up.add_motions(both, self.tools.settings.batch)
        return made

    def _check(self, each: SideSearch, made: MadeMotion) -> MadeMotion:
        """Refuse a motion that takes a known way, or that is not accepted."""
        if made.motion is None:
            return made
        motion, robot = made.motion, self._world.robot
        way = sample_way(motion)
        for other in each.kept:
            known = [other, other.mirrored(robot)] if each.side in SYMMETRIC else [other]
            if any(are_same(way, sample_way(motion)) for motion in known):
                each.repeats += 1
                return made.refuse(f"takes the way of '{other.name}'")
        reason = self._accept(made.motion)
        return made.refuse(reason) if reason else made
