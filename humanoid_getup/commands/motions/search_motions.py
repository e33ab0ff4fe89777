"""Searches motions of a robot in physics, and stores what it finds as it goes."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.motions.build import UNFINISHED, motion_file
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from humanoid_getup.motions.keyframes_writer import append_keyframes, replace_keyframes
from humanoid_getup.motions.motion import FOUND, Motion
from humanoid_getup.motions.motion_database import (
    MOTION_FOLDER,
    label_key,
    list_found,
    list_sides,
    load_key,
)
from humanoid_getup.playback.preflight import preflight_stored
from humanoid_getup.posture_chains.chain_search import ChainTools, SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.motion_maker import MadeMotion
from humanoid_getup.posture_chains.search_file import (
    describe_search,
    make_recipe,
    read_search,
    restore_search,
)
from humanoid_getup.posture_chains.ways_up import check_lifting
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Robot, TorqueLimit
from robots.body.limbs import Limbs
from robots.quaternion import Array
from robots.storage.arrays import save_arrays
from robots.storage.validation import name_choices

if TYPE_CHECKING:
    from humanoid_getup.commands.motions.discover_motions import DiscoverRequest

BUDGET = 300_000.0  # s simulated
SAVED_EVERY = 60.0  # s
SEARCH = "search.npz"


@dataclass(frozen=True, kw_only=True, eq=False)
class NearestStand:
    """How near to a stand a search came that has no motion from a side."""

    side: LyingSide
    moves: int
    """Of the best chain to a stand, or to the posture that is nearest to one."""
    neck: float
    """Height of the neck at its end, as a share of that of the stance."""
    stands: bool
    """Whether it ends in a stand."""
    qpos: Array
    """Where the robot rests along it, MuJoCo positions (moves + 1, nq)."""

    @classmethod
    def of(cls, each: SideSearch, tools: ChainTools) -> NearestStand:
        """Find the best chain of a side, undisturbed."""
        chains = each.search.chains
        path = tools.player.trace(chains[0]) if chains else each.search.archive.best.path
        qpos = np.array([state.qpos for state in path])
        neck = tools.goal.measure_neck(qpos[-1])
        return cls(side=each.side, moves=len(path) - 1, neck=neck, stands=bool(chains), qpos=qpos)

    def describe(self) -> str:
        """Describe it in one line."""
        if self.stands:
            return (
                f"{self.side}: the best chain stands after {self.moves} moves, but no motion made "
                "of one was kept"
            )
        return (
            f"{self.side}: no chain stands; the posture nearest to a stand, after {self.moves} "
            f"moves, has its neck at {self.neck:.0%} of its height"
        )


class MotionSearch:
    """A search in physics for motions of one robot, which can be interrupted and resumed."""

    def __init__(self, robot: Robot, request: DiscoverRequest, monitor: ProgressMonitor) -> None:
        """Begin a search, for which `check_begin` was called, or go on with the stored one."""
        self._robot, self._request, self._monitor = robot, request, monitor
        self._world, self._sides = World(robot), choose_sides(request, robot)
        Limbs(robot)  # refuses a robot without arms or legs
        limit = TorqueLimit(request.torque_limit).on(robot)
        settings, through = SearchSettings(limit=limit), request.through
        key = None if through is None else load_key(through, robot)
        self._recipe = make_recipe(self._world, settings, self._sides, request.seed, through)
        file = self.file(robot)
        arrays = read_search(file, self._recipe) if file.exists() else None
        monitor.begin("squats")
        self._discovery = ChainDiscovery(
            self._world,
            seed=request.seed,
            sides=self._sides,
            most=request.most,
            settings=settings,
            through=key,
            accept=self._preflight,
            announce=self._show_making,
        )
        if arrays is not None:
            restore_search(file, arrays, self._discovery, self._load)
            sides = ", ".join(map(_describe_side, self.sides))
            monitor.tell(f"goes on after {self._discovery.simulated:,.0f} s simulated: {sides}")
        self._begun = self._discovery.simulated
        self._saved, self._state = time.monotonic(), self._describe()
        for side in self._discovery.skipped:
            monitor.tell(f"{side}: no posture was found in which the robot stays on this side")
        self._tell_weakness()

    @property
    def sides(self) -> list[SideSearch]:
        """Return the searches from each side."""
        return self._discovery.sides

    def list_wanting(self) -> tuple[str, ...]:
        """List the sides without a motion."""
        kept = {each.side for each in self.sides if each.kept}
        return tuple(side for side in self._sides if side not in kept)

    def list_nearest(self) -> tuple[NearestStand, ...]:
        """List how near to a stand the search came from each side without a motion."""
        tools = self._discovery.tools
        return tuple(NearestStand.of(each, tools) for each in self.sides if not each.kept)

    @staticmethod
    def file(robot: Robot) -> Path:
        """Return the file of a robot's search that ended before it was done."""
        return robot.folder / UNFINISHED / SEARCH

    def run(self) -> None:
        """Search until enough is found or the budget is spent; store what is found."""
        try:
            while not self._discovery.is_done and self._spent < self._budget:
                for each, made in self._discovery.advance():
                    self._keep(each, made)
                self._state = self._describe()
                self._save(SAVED_EVERY)
                self._show(", ".join(map(_describe_side, self.sides)))
            for each, made in self._discovery.conclude():
                self._keep(each, made)
                self._state = self._describe()
        except BaseException:
            self._save()
            raise
        self._end()

    @property
    def _budget(self) -> float:
        return self._request.budget or BUDGET

    @property
    def _spent(self) -> float:
        return self._discovery.simulated - self._begun

    def _show(self, note: str) -> None:
        done = min(self._spent, self._budget)
        self._monitor.show(Progress(phase="search", done=done, total=self._budget, note=note))

    def _show_making(self, each: SideSearch) -> None:
        self._show(f"{each.side}: making a motion of a chain")

    def _keep(self, each: SideSearch, made: MadeMotion) -> None:
        """Store a motion and its keys; tell what was found."""
        if made.motion is None:
            self._monitor.tell(f"{each.side}: a rise was found that is not kept: {made.failure}")
            return
        file = motion_file(self._robot.folder, made.motion.name)
        file.parent.mkdir(exist_ok=True)
        self._write_keys(made.keyframes)
        made.motion.save(file)
        self._monitor.tell(describe_motion(made.motion))

    def _write_keys(self, keyframes: Keyframes) -> None:
        path = self._robot.folder / KEYFRAMES
        there = keyframes.name in _list_keys(self._robot)
        (replace_keyframes if there else append_keyframes)(path, [keyframes], self._robot)

    def _describe(self) -> dict[str, Any]:
        """Describe the search between two rounds, where it can go on alike."""
        return describe_search(self._discovery, self._recipe)

    def _save(self, every: float = 0.0) -> None:
        """Save the search as it was after the last round, if it was not within some seconds."""
        if time.monotonic() - self._saved < every:
            return
        path = self.file(self._robot)
        path.parent.mkdir(exist_ok=True)
        save_arrays(path, self._state)
        self._saved = time.monotonic()

    def _end(self) -> None:
        """Save a search that is not done; remove the file of one that is."""
        if not self._discovery.is_done:
            self._save()
            return
        path = self.file(self._robot)
        path.unlink(missing_ok=True)
        with suppress(OSError):  # it is not empty, or not there
            path.parent.rmdir()

    def _tell_weakness(self) -> None:
        """Tell which servo is too weak for a rise, or that servos have little to spare."""
        tools = self._discovery.tools
        found = check_lifting(self._world, tools.moves, tools.settings.limit)
        if found is not None:
            self._monitor.tell(found.describe())
        elif self._discovery.is_weak:
            self._monitor.tell(
                f"motions are judged with no less than {self._discovery.least_share:.0%} of the "
                "torque: with less, the servos lift the robot out of few of its squats"
            )

    def _load(self, name: str) -> Motion:
        return Motion.load(motion_file(self._robot.folder, name))

    def _preflight(self, motion: Motion) -> str:
        """Return why the preflight refuses a motion; "" if it does not."""
        verdict = preflight_stored(self._world, motion)
        return "" if verdict.passed else f"the preflight refuses it: {verdict.reasons[0]}"


def check_begin(robot: Robot, request: DiscoverRequest) -> None:
    """Refuse to begin where an earlier search or its motions are, and to resume where none is."""
    sides, keys = choose_sides(request, robot), _list_keys(robot)  # refuses a damaged file
    path = MotionSearch.file(robot)
    if request.resume:
        if not path.exists():
            raise BadInputError(
                f"there is no search to resume: {path} is missing; leave out --resume"
            )
        return
    if path.exists():
        raise BadInputError(
            f"a search that ended before it was done is there: go on with --resume, or remove "
            f"{path} first"
        )
    label = FOUND if request.through is None else label_key(request.through)
    known = [name for side in sides for name in _list_known(robot, side, keys, label)]
    if known:
        rest = [side for side in sides if not _list_known(robot, side, keys, label)]
        others = f", or search the others with --sides {','.join(rest)}" if rest else ""
        raise BadInputError(
            f"motions of an earlier search are there: {', '.join(known)}; remove them from "
            f"{robot.folder / MOTION_FOLDER} and {KEYFRAMES} first{others}"
        )


def _list_keys(robot: Robot) -> list[str]:
    """List the names of the robot's keyframes."""
    path = robot.folder / KEYFRAMES
    known = load_keyframes(path, robot) if path.exists() else []
    return [each.name for each in known]


def _list_known(robot: Robot, side: LyingSide, keys: list[str], label: str) -> list[str]:
    """List motions and keys of an earlier search from a side, by their label."""
    begin = f"{side}_{label}_"
    found = list_found(robot, side, label)
    return sorted({*found} | {name for name in keys if name.startswith(begin)})


def choose_sides(request: DiscoverRequest, robot: Robot) -> tuple[LyingSide, ...]:
    """Choose the sides from which motions are searched, in their usual order."""
    sides = list_sides(robot)
    problems = [
        f"--sides is '{side}', expected {name_choices(sides)}"
        for side in request.sides
        if side not in sides
    ]
    if problems:
        raise BadInputError(*problems)
    return tuple(side for side in sides if side in (request.sides or sides))


def describe_motion(motion: Motion) -> str:
    """Describe a motion that was found."""
    share = float(motion.provenance["disturbed_success"])
    return (
        f"motion '{motion.name}' ({motion.strategy}) stands after {motion.stand_time:.2f} s, "
        f"in {share:.0%} of disturbed worlds"
    )


def _describe_side(each: SideSearch) -> str:
    if each.kept:
        return f"{each.side}: {len(each.kept)} kept"
    if each.search.chains:
        return f"{each.side}: a chain stands"
    return f"{each.side}: {each.search.archive.best.progress:.0%}"
