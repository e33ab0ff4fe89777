"""Files of searches: all that a discovery needs to go on where it ended."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove, RestingState
from humanoid_getup.posture_chains.stored_states import (
    MEMBERS,
    MOVES,
    NOTHING,
    STATES,
    StoredStates,
)
from humanoid_getup.progress.ledger import check_recipe
from humanoid_getup.simulation.world import World
from robots.storage.arrays import load_arrays, to_text
from robots.storage.validation import shown

VERSION = 8
"""Changes when files of earlier searches cannot be continued."""
ARCHIVES = (MEMBERS, "draws", "chains", "risen", "paired")
TEXTS = ("recipe", "rng", "counts")
SIDES, LIMIT = "choice of sides", "torque limit"
"""Keys of a recipe."""
NO_LIMIT, UNIT_OF_LIMIT = "none", " N·m"
BEGIN_AGAIN = "remove the file to begin again"
REMEDY = f"give the same options and leave the robot as it was, or {BEGIN_AGAIN}"
DAMAGE = (ValueError, KeyError, IndexError, TypeError, OverflowError, RecursionError)

Recipe = dict[str, Any]
"""What a search must have in common with a file to go on from it."""
Positive = Annotated[float, msgspec.Meta(ge=0.0)]
Count = Annotated[int, msgspec.Meta(ge=0)]


class SideCounts(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Numbers of the search from a side."""

    tried: Count
    repeats: Count
    spent: Positive
    ready: Positive
    first: Positive

    @classmethod
    def of(cls, each: SideSearch) -> SideCounts:
        """Collect the numbers of a side."""
        return cls(each.tried, each.repeats, each.spent, each.ready, each.first)


class SearchCounts(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Numbers of a search."""

    simulated: tuple[Positive, Positive]
    """By the search and in making motions [s]."""
    kept: list[list[str]]
    """Motions of each side, by name."""
    turns: list[Count]
    sides: list[SideCounts]


class StoredOptions(msgspec.Struct, frozen=True):
    """Options of a search that is stored, read from its recipe."""

    seed: Annotated[int, msgspec.Meta(ge=0, le=2**31)]
    worlds: Annotated[int, msgspec.Meta(ge=1)]
    sides: str = msgspec.field(name=SIDES)
    limit: str = msgspec.field(name=LIMIT)

    def __post_init__(self) -> None:
        """Refuse a limit that is none."""
        limit = self.torque_limit
        if limit is not None and not (math.isfinite(limit) and limit > 0.0):
            raise ValueError(f"the limit is {limit:g} N·m, expected one above 0")

    @property
    def torque_limit(self) -> float | None:
        """Return the torque limit of every servo [N·m]; None without one."""
        return None if self.limit == NO_LIMIT else float(self.limit.removesuffix(UNIT_OF_LIMIT))


@dataclass(frozen=True, kw_only=True, eq=False)
class FiledStates:
    """What a search has filed so far."""

    ways_up: list[RestingState]
    sides: list[list[RestingState]]
    """States that were reached from each side on which the robot stays."""
    simulated: float
    """[s]"""
    options: StoredOptions


def identify_world(world: World) -> Recipe:
    """Describe the robot whose states a file holds."""
    return {
        "version": VERSION,
        "robot.toml or model": hashlib.sha256(world.content).hexdigest(),
        "robot": world.robot.name,
    }


def make_recipe(world: World, settings: SearchSettings, sides: Sequence[str], seed: int) -> Recipe:
    """Describe what a search must have in common with a file to go on from it."""
    limit = settings.limit.value
    return identify_world(world) | {
        "seed": seed,
        SIDES: ", ".join(sides),
        "batch": settings.batch,
        "worlds": settings.worlds,
        LIMIT: NO_LIMIT if limit is None else f"{limit:g}{UNIT_OF_LIMIT}",
    }


def describe_search(discovery: ChainDiscovery, recipe: Recipe) -> dict[str, Any]:
    """Describe the state of a search between two rounds by the arrays of a file."""
    return _Writer(discovery).write() | {"recipe": json.dumps(recipe)}


def read_search(path: Path, recipe: Recipe) -> dict[str, Any]:
    """Read the arrays of a search's file.

    Raises:
        ValueError: if it is damaged, or of another robot, version or seed.
        OSError: if it cannot be read.
    """
    arrays, kept = _load(path)
    check_recipe(path, recipe, kept, REMEDY)
    return arrays


def read_states(path: Path, world: World) -> FiledStates:
    """Read what a search of a robot has filed, whatever its options are.

    Raises:
        ValueError: if it is damaged, or of another robot or version.
        OSError: if it cannot be read.
    """
    arrays, kept = _load(path)
    own = identify_world(world)
    check_recipe(path, own, {key: kept.get(key) for key in own}, REMEDY)
    with _naming_damage(path):
        options = msgspec.convert(kept, StoredOptions)
        ups, *sides = StoredStates(arrays, world, options.worlds).read_archives()
        return FiledStates(
            ways_up=ups,
            sides=sides,
            simulated=sum(_read_counts(arrays).simulated),
            options=options,
        )


def read_simulated(path: Path) -> float:
    """Read how long a search has simulated [s].

    Raises:
        ValueError: if the file is damaged.
        OSError: if it cannot be read.
    """
    arrays, _ = _load(path)
    with _naming_damage(path):
        return sum(_read_counts(arrays).simulated)


def restore_search(
    path: Path, arrays: dict[str, Any], discovery: ChainDiscovery, load: Callable[[str], Motion]
) -> None:
    """Bring a search that was just begun to the state of a file.

    Args:
        arrays: Of that file.
        discovery: A search with the same recipe.
        load: Loads a motion that was kept, by its name.

    Raises:
        ValueError: if it is damaged.
        OSError: if a motion that was kept cannot be read.
    """
    with _naming_damage(path):
        _Reader(arrays, discovery).restore(load)


def _load(path: Path) -> tuple[dict[str, Any], Recipe]:
    """Load the arrays and the recipe of a file."""
    with _naming_damage(path):
        arrays = load_arrays(path, (*STATES, *MOVES, *ARCHIVES, *TEXTS), max_bytes=2**29)
        kept = json.loads(to_text(arrays["recipe"], "recipe"))
        if not isinstance(kept, dict):
            raise ValueError(f"recipe is {shown(kept)}, expected a table")
    return arrays, kept


@contextmanager
def _naming_damage(path: Path) -> Iterator[None]:
    """Name the file and the remedy where its content is damaged."""
    try:
        yield
    except DAMAGE as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"{path}: {reason} ({BEGIN_AGAIN})") from error


class _Writer:
    """Numbers all states and moves of a discovery, and writes them as arrays."""

    def __init__(self, discovery: ChainDiscovery) -> None:
        self._discovery = discovery
        self._states: dict[RestingState, int] = {}
        self._moves: dict[PostureMove, int] = {}

    def write(self) -> dict[str, Any]:
        discovery, ups = self._discovery, self._discovery.tools.ways_up
        archives = [ups.archive, *(each.search.archive for each in discovery.sides)]
        members = [[self._number(state) for state in archive] for archive in archives]
        chains = [
            [side, kind, chain.fallen, *map(self._number_move, chain.moves)]
            for side, each in enumerate(discovery.sides)
            for kind, some in enumerate((each.search.chains, each.search.untried))
            for chain in some
        ]
        risen = [self._known(each.search.risen) for each in discovery.sides]
        here = {state for each in discovery.sides for state in each.search.archive}
        there = set(ups)
        paired = [
            [self._number(s), self._number(u)] for s, u in ups.paired if s in here and u in there
        ]
        return {
            **self._write_states(),
            **self._write_moves(),
            "members": _pad(members),
            "draws": _pad([archive.draws for archive in archives]),
            "chains": _pad(chains),
            "risen": _pad(risen),
            "paired": np.array(sorted(paired), dtype=int).reshape(-1, 2),
            "rng": json.dumps(discovery.tools.rng.bit_generator.state),
            "counts": json.dumps(msgspec.to_builtins(_count(discovery))),
        }

    def _known(self, states: Iterable[RestingState]) -> list[int]:
        return sorted(self._states[state] for state in states if state in self._states)

    def _number(self, state: RestingState) -> int:
        """Number a state after all to which it leads."""
        todo = [state]
        while todo:
            last = todo[-1]
            links = [link for link in (last.before, last.after) if link is not None]
            if new := [link for link in links if link not in self._states]:
                todo += new
                continue
            self._states.setdefault(last, len(self._states))
            todo.pop()
        return self._states[state]

    def _number_move(self, move: PostureMove) -> int:
        return self._moves.setdefault(move, len(self._moves))

    def _write_states(self) -> dict[str, Any]:
        states, worlds = [*self._states], self._discovery.tools.settings.worlds
        links = [
            [
                NOTHING if state.before is None else self._states[state.before],
                NOTHING if state.after is None else self._states[state.after],
                NOTHING if state.move is None else self._number_move(state.move),
                NOTHING if state.onward is None else self._number_move(state.onward),
            ]
            for state in states
        ]
        return {
            "qpos": np.array([state.qpos for state in states]),
            "arrivals": np.array([state.list_arrivals(worlds - 1) for state in states]),
            "target": np.array([state.target for state in states]),
            "cell": np.array([state.cell for state in states]),
            "progress": np.array([state.progress for state in states]),
            "place": np.array([state.place for state in states]),
            "links": np.array(links, dtype=int),
            "depth": np.array([state.depth for state in states]),
        }

    def _write_moves(self) -> dict[str, Any]:
        moves, none = [*self._moves], np.zeros((0, self._discovery.tools.world.robot.n))
        return {
            "knots": np.concatenate([none, *(move.knots for move in moves)]),
            "knot_count": np.array([len(move.knots) for move in moves], dtype=int),
            "duration": np.array([move.duration for move in moves], dtype=float),
            "kind": np.array([move.kind for move in moves], dtype=str),
        }


class _Reader:
    """Restores a discovery from arrays."""

    def __init__(self, arrays: dict[str, Any], discovery: ChainDiscovery) -> None:
        self._arrays, self._discovery = arrays, discovery
        self._stored = StoredStates(arrays, discovery.tools.world, discovery.tools.settings.worlds)

    def restore(self, load: Callable[[str], Motion]) -> None:
        arrays, discovery = self._arrays, self._discovery
        stored, ups, sides = self._stored, discovery.tools.ways_up, len(discovery.sides)
        count, read_numbers = len(stored.states), stored.read_numbers
        archives = [ups.archive, *(each.search.archive for each in discovery.sides)]
        members = stored.read_archives(len(archives))
        draws = read_numbers("draws", arrays[MEMBERS].shape, np.inf)
        for archive, states, drawn in zip(archives, members, draws, strict=True):
            if np.any(drawn[: len(states)] < 0):
                raise ValueError("draws says of a state that it was drawn fewer than 0 times")
            archive.restore(states, drawn[: len(states)].tolist())
        ups.stance = next(iter(ups)).root
        risen = read_numbers("risen", (sides, None), count)
        for each, row in zip(discovery.sides, risen, strict=True):
            each.search.start = next(iter(each.search.archive)).path[0]
            each.search.risen = {stored.states[k] for k in row if k != NOTHING}
            each.search.chains, each.search.untried = [], []
        self._restore_chains()
        paired = read_numbers("paired", (None, 2), count)
        ups.paired = {(stored.states[s], stored.states[u]) for s, u in paired}
        discovery.tools.rng.bit_generator.state = json.loads(to_text(arrays["rng"], "rng"))
        _restore_counts(discovery, _read_counts(arrays), load)

    def _restore_chains(self) -> None:
        sides = self._discovery.sides
        chains = self._stored.read_numbers("chains", (None, None), np.inf)
        for side, kind, fallen, *moves in chains.tolist():
            if not (
                0 <= side < len(sides)
                and 0 <= kind < 2
                and max(moves, default=NOTHING) < len(self._stored.moves)
            ):
                raise ValueError("chains holds a side, a kind or a move that is not there")
            search = sides[side].search
            chain = self._find_chain(search.start, fallen, [k for k in moves if k != NOTHING])
            (search.chains, search.untried)[kind].append(chain)

    def _find_chain(self, start: RestingState, fallen: int, moves: Sequence[int]) -> PostureChain:
        return PostureChain(
            start=start.qpos,
            held=start.target,
            moves=tuple(self._stored.moves[k] for k in moves),
            fallen=fallen,
        )


def _count(discovery: ChainDiscovery) -> SearchCounts:
    """Collect the numbers of a discovery."""
    player, maker = discovery.tools.player, discovery.maker
    return SearchCounts(
        simulated=(player.simulated, maker.simulated),
        kept=[[motion.name for motion in each.kept] for each in discovery.sides],
        turns=[each.search.turn for each in discovery.sides],
        sides=[SideCounts.of(each) for each in discovery.sides],
    )


def _read_counts(arrays: dict[str, Any]) -> SearchCounts:
    return msgspec.convert(json.loads(to_text(arrays["counts"], "counts")), SearchCounts)


def _restore_counts(
    discovery: ChainDiscovery, counts: SearchCounts, load: Callable[[str], Motion]
) -> None:
    rows = zip(discovery.sides, counts.kept, counts.turns, counts.sides, strict=True)
    for each, names, turn, row in rows:
        each.kept, each.search.turn = [load(name) for name in names], turn
        each.tried, each.repeats = row.tried, row.repeats
        each.spent, each.ready, each.first = row.spent, row.ready, row.first
    discovery.tools.player.simulated, discovery.maker.simulated = counts.simulated


def _pad(rows: Sequence[Sequence[int]]) -> np.ndarray:
    """Make one array of rows of numbers, the short ones filled up with `NOTHING`."""
    width = max((len(row) for row in rows), default=0)
    padded = [[*row, *[NOTHING] * (width - len(row))] for row in rows]
    return np.array(padded, dtype=int).reshape(len(rows), width)
