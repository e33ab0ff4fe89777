"""Files of searches: all that a discovery needs to go on where it ended."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.resting_state import Archive, PostureChain
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

VERSION = 9
"""Changes when files of earlier searches cannot be continued."""
ARCHIVES = (MEMBERS, "draws", "chains", "risen", "paired")
TEXTS = ("recipe", "rng", "counts")
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


def make_recipe(
    world: World,
    settings: SearchSettings,
    sides: Sequence[str],
    seed: int,
    through: str | None = None,
) -> Recipe:
    """Describe what a search must have in common with a file to go on from it."""
    limit = settings.limit.value
    return {
        "version": VERSION,
        "robot.toml or model": hashlib.sha256(world.content).hexdigest(),
        "robot": world.robot.name,
        "seed": seed,
        "choice of sides": ", ".join(sides),
        "through": through or "none",
        "batch": settings.batch,
        "worlds": settings.worlds,
        "torque limit": "none" if limit is None else f"{limit:g} N·m",
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
    with _naming_damage(path):
        arrays = load_arrays(path, (*STATES, *MOVES, *ARCHIVES, *TEXTS), max_bytes=2**29)
        kept = json.loads(to_text(arrays["recipe"], "recipe"))
        if not isinstance(kept, dict):
            raise ValueError(f"recipe is {shown(kept)}, expected a table")
    check_recipe(path, recipe, kept, REMEDY)
    return arrays


def restore_search(
    path: Path, arrays: dict[str, Any], discovery: ChainDiscovery, load: Callable[[str], Motion]
) -> None:
    """Bring a search that was just begun to the state of a file, given its arrays.

    The search has the same recipe; ``load`` loads a motion that was kept, by its name.
    """
    with _naming_damage(path):
        _restore(arrays, discovery, load)


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
    stored = StoredStates(arrays, tools.world, tools.goal, tools.settings.worlds)
    ups, count, read_numbers = tools.ways_up, len(stored.states), stored.read_numbers
    members = stored.read_archives(len(archives))
    draws = read_numbers("draws", arrays[MEMBERS].shape, np.inf)
    for archive, states, drawn in zip(archives, members, draws, strict=True):
        if np.any(drawn[: len(states)] < 0):
            raise ValueError("draws says of a state that it was drawn fewer than 0 times")
        archive.restore(states, drawn[: len(states)].tolist())
    ups.goal = next(iter(ups)).root
    risen = read_numbers("risen", (len(sides), None), count)
    for each, row in zip(sides, risen, strict=True):
        each.search.start = next(iter(each.search.archive)).path[0]
        each.search.risen = {stored.states[k] for k in row if k != NOTHING}
        each.search.chains, each.search.untried = [], []
    _restore_chains(stored, sides)
    paired = read_numbers("paired", (None, 2), count)
    ups.paired = {(stored.states[s], stored.states[u]) for s, u in paired}
    tools.rng.bit_generator.state = json.loads(to_text(arrays["rng"], "rng"))
    counts = msgspec.convert(json.loads(to_text(arrays["counts"], "counts")), SearchCounts)
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
