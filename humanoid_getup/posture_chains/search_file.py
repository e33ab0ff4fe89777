"""Files of searches: all that a discovery needs to go on where it ended."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.resting_state import Archive, PostureChain, RestingState
from humanoid_getup.posture_chains.stored_states import (
    MEMBERS,
    MOVES,
    NOTHING,
    STATES,
    NumberedStates,
    StoredStates,
    pad,
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
    tools, sides, numbers = discovery.tools, discovery.sides, NumberedStates()
    archives = _list_archives(discovery)
    members = [[numbers.number(state) for state in archive] for archive in archives]
    chains = [
        [side, kind, chain.fallen, *map(numbers.number_move, chain.moves)]
        for side, each in enumerate(sides)
        for kind, some in enumerate((each.search.chains, each.search.untried))
        for chain in some
    ]
    risen = [sorted(numbers.number(s) for s in e.search.risen if s in numbers) for e in sides]
    here, there = {state for each in sides for state in each.search.archive}, set(tools.ways_up)
    paired = [
        [numbers.number(s), numbers.number(u)]
        for s, u in tools.ways_up.paired
        if s in here and u in there
    ]
    counts = SearchCounts(
        simulated=(tools.player.simulated, discovery.maker.simulated),
        kept=[[motion.name for motion in each.kept] for each in sides],
        turns=[each.search.turn for each in sides],
        sides=[
            SideCounts(each.tried, each.repeats, each.spent, each.ready, each.first)
            for each in sides
        ],
    )
    return {
        **numbers.write(tools.world.robot.n, tools.settings.worlds - 1),
        MEMBERS: pad(members),
        "draws": pad([archive.draws for archive in archives]),
        "chains": pad(chains),
        "risen": pad(risen),
        "paired": np.array(sorted(paired), dtype=int).reshape(-1, 2),
        "rng": json.dumps(tools.rng.bit_generator.state),
        "counts": json.dumps(msgspec.to_builtins(counts)),
        "recipe": json.dumps(recipe),
    }


def _list_archives(discovery: ChainDiscovery) -> list[Archive]:
    """List the archive of ways up, then that of each side."""
    return [discovery.tools.ways_up.archive, *(each.search.archive for each in discovery.sides)]


def read_search(path: Path, recipe: Recipe) -> dict[str, Any]:
    """Read the arrays of a search's file; refuse another robot, version or seed."""
    arrays, kept = _load(path)
    check_recipe(path, recipe, kept, REMEDY)
    return arrays


def read_states(path: Path, world: World) -> FiledStates:
    """Read what a search of a robot has filed, whatever its options are."""
    arrays, kept = _load(path)
    own = identify_world(world)
    check_recipe(path, own, {key: kept.get(key) for key in own}, REMEDY)
    with _naming_damage(path):
        options = msgspec.convert(kept, StoredOptions)
        ups, *sides = StoredStates(arrays, world, options.worlds).read_archives()
        return FiledStates(
            ways_up=ups, sides=sides, simulated=sum(_read_counts(arrays).simulated), options=options
        )


def restore_search(
    path: Path, arrays: dict[str, Any], discovery: ChainDiscovery, load: Callable[[str], Motion]
) -> None:
    """Bring a search that was just begun to the state of a file, given its arrays.

    The search has the same recipe; ``load`` loads a motion that was kept, by its name.
    """
    with _naming_damage(path):
        _restore(arrays, discovery, load)


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


def _restore(
    arrays: dict[str, Any], discovery: ChainDiscovery, load: Callable[[str], Motion]
) -> None:
    tools, sides, archives = discovery.tools, discovery.sides, _list_archives(discovery)
    stored = StoredStates(arrays, tools.world, tools.settings.worlds)
    ups, count, read_numbers = tools.ways_up, len(stored.states), stored.read_numbers
    members = stored.read_archives(len(archives))
    draws = read_numbers("draws", arrays[MEMBERS].shape, np.inf)
    for archive, states, drawn in zip(archives, members, draws, strict=True):
        if np.any(drawn[: len(states)] < 0):
            raise ValueError("draws says of a state that it was drawn fewer than 0 times")
        archive.restore(states, drawn[: len(states)].tolist())
    ups.stance = next(iter(ups)).root
    risen = read_numbers("risen", (len(sides), None), count)
    for each, row in zip(sides, risen, strict=True):
        each.search.start = next(iter(each.search.archive)).path[0]
        each.search.risen = {stored.states[k] for k in row if k != NOTHING}
        each.search.chains, each.search.untried = [], []
    _restore_chains(stored, sides)
    paired = read_numbers("paired", (None, 2), count)
    ups.paired = {(stored.states[s], stored.states[u]) for s, u in paired}
    tools.rng.bit_generator.state = json.loads(to_text(arrays["rng"], "rng"))
    counts = _read_counts(arrays)
    rows = zip(sides, counts.kept, counts.turns, counts.sides, strict=True)
    for each, names, turn, row in rows:
        each.kept, each.search.turn = [load(name) for name in names], turn
        each.tried, each.repeats = row.tried, row.repeats
        each.spent, each.ready, each.first = row.spent, row.ready, row.first
    tools.player.simulated, discovery.maker.simulated = counts.simulated


def _restore_chains(stored: StoredStates, sides: list[SideSearch]) -> None:
    chains = stored.read_numbers("chains", (None, None), np.inf)
    for side, kind, fallen, *moves in chains.tolist():
        if not (
            0 <= side < len(sides)
            and 0 <= kind < 2
            and max(moves, default=NOTHING) < len(stored.moves)
        ):
            raise ValueError("chains holds a side, a kind or a move that is not there")
        search = sides[side].search
        chain = PostureChain(
            start=search.start.qpos,
            held=search.start.target,
            moves=tuple(stored.moves[k] for k in moves if k != NOTHING),
            fallen=fallen,
        )
        (search.chains, search.untried)[kind].append(chain)


def _read_counts(arrays: dict[str, Any]) -> SearchCounts:
    return msgspec.convert(json.loads(to_text(arrays["counts"], "counts")), SearchCounts)
