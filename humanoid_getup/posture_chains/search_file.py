"""Files of searches: all that a discovery needs to go on where it ended."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove, RestingState
from humanoid_getup.progress.ledger import check_recipe
from robots.storage.arrays import load_arrays, to_numbers, to_text
from robots.storage.validation import shown

VERSION = 3
"""Changes when files of earlier searches cannot be continued."""
STATES = ("qpos", "target", "cell", "progress", "place", "links", "depth")
MOVES = ("knots", "knot_count", "duration", "kind")
ARCHIVES = ("members", "draws", "chains", "risen", "paired")
TEXTS = ("recipe", "rng", "counts")
COUNTS = ("tried", "repeats", "spent", "ready", "first")
"""Numbers of a side."""
NOTHING = -1
REMEDY = "give the same options, or remove the file to begin again"


def make_recipe(discovery: ChainDiscovery, seed: int) -> dict[str, Any]:
    """Describe what a search must have in common with a file to go on from it."""
    settings, world = discovery.tools.settings, discovery.tools.world
    return {
        "version": VERSION,
        "world": hashlib.sha256(world.content).hexdigest(),
        "robot": world.robot.name,
        "seed": seed,
        "sides": [each.side for each in discovery.sides],
        "batch": settings.batch,
        "worlds": settings.worlds,
        "torque_limit": settings.limit.value,
    }


def describe_search(discovery: ChainDiscovery, seed: int) -> dict[str, Any]:
    """Describe the state of a search between two rounds by the arrays of a file."""
    recipe = json.dumps(make_recipe(discovery, seed))
    return _Writer(discovery).write() | {"recipe": recipe}


def restore_search(
    path: Path, discovery: ChainDiscovery, seed: int, load: Callable[[str], Motion]
) -> None:
    """Bring a search that was just begun to the state of a file.

    Args:
        path: File.
        discovery: A search with the same options.
        seed: Of the search.
        load: Loads a motion that was kept, by its name.

    Raises:
        ValueError: if it is damaged, or of another robot, version or seed.
        OSError: if it cannot be read.
    """
    try:
        arrays = load_arrays(path, (*STATES, *MOVES, *ARCHIVES, *TEXTS), max_bytes=2**29)
        kept = json.loads(to_text(arrays["recipe"], "recipe"))
        if not isinstance(kept, dict):
            raise ValueError(f"recipe is {shown(kept)}, expected a table")
    except ValueError as error:
        raise ValueError(f"{path}: {error} ({REMEDY})") from error
    check_recipe(path, make_recipe(discovery, seed), kept, REMEDY)
    try:
        _Reader(arrays, discovery).restore(load)
    except (ValueError, KeyError, IndexError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"{path}: {reason} ({REMEDY})") from error


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
            "counts": json.dumps(_count(discovery)),
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
        states = [*self._states]
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
        self._moves = self._read_moves()
        self._states = self._read_states()

    def restore(self, load: Callable[[str], Motion]) -> None:
        arrays, discovery = self._arrays, self._discovery
        ups = discovery.tools.ways_up
        archives = [ups.archive, *(each.search.archive for each in discovery.sides)]
        rows = zip(archives, arrays["members"], arrays["draws"], strict=True)
        for archive, members, draws in rows:
            states = [self._states[k] for k in members if k != NOTHING]
            archive.restore(states, draws[: len(states)].tolist())
        ups.stance = next(iter(ups)).root
        for each, risen in zip(discovery.sides, arrays["risen"], strict=True):
            each.search.start = next(iter(each.search.archive)).path[0]
            each.search.risen = {self._states[k] for k in risen if k != NOTHING}
            each.search.chains, each.search.untried = [], []
        for side, kind, fallen, *moves in arrays["chains"].tolist():
            search = discovery.sides[side].search
            chain = self._find_chain(search.start, fallen, [k for k in moves if k != NOTHING])
            (search.chains, search.untried)[kind].append(chain)
        ups.paired = {(self._states[s], self._states[u]) for s, u in arrays["paired"]}
        discovery.tools.rng.bit_generator.state = json.loads(to_text(arrays["rng"], "rng"))
        _restore_counts(discovery, json.loads(to_text(arrays["counts"], "counts")), load)

    def _find_chain(self, start: RestingState, fallen: int, moves: Sequence[int]) -> PostureChain:
        return PostureChain(
            start=start.qpos,
            held=start.target,
            moves=tuple(self._moves[k] for k in moves),
            fallen=fallen,
        )

    def _read_moves(self) -> list[PostureMove]:
        arrays = self._arrays
        n = self._discovery.tools.world.robot.n
        knots = to_numbers(arrays["knots"], "knots", (None, n))
        ends = np.cumsum(arrays["knot_count"])
        if len(ends) and ends[-1] != len(knots):
            raise ValueError(f"knots has {len(knots)} rows, expected {ends[-1]}")
        parts = np.split(knots, ends[:-1]) if len(ends) else []
        rows = zip(parts, arrays["duration"], arrays["kind"], strict=True)
        return [
            PostureMove(knots=part, duration=float(time), kind=str(kind))
            for part, time, kind in rows
        ]

    def _read_states(self) -> list[RestingState]:
        arrays, world = self._arrays, self._discovery.tools.world
        qpos = to_numbers(arrays["qpos"], "qpos", (None, world.model.nq))
        target = to_numbers(arrays["target"], "target", (len(qpos), world.robot.n))
        progress = to_numbers(arrays["progress"], "progress", (len(qpos),))
        place = to_numbers(arrays["place"], "place", (len(qpos), None))
        states: list[RestingState] = []
        for k, (before, after, move, onward) in enumerate(arrays["links"].tolist()):
            if max(before, after) >= k:
                raise ValueError(f"state {k} leads to one after it")
            states.append(
                RestingState(
                    qpos=qpos[k],
                    target=target[k],
                    cell=tuple(arrays["cell"][k].tolist()),
                    progress=float(progress[k]),
                    place=place[k],
                    before=None if before == NOTHING else states[before],
                    after=None if after == NOTHING else states[after],
                    move=None if move == NOTHING else self._moves[move],
                    onward=None if onward == NOTHING else self._moves[onward],
                    depth=int(arrays["depth"][k]),
                )
            )
        return states


def _count(discovery: ChainDiscovery) -> dict[str, Any]:
    """Collect the numbers of a discovery."""
    player, maker = discovery.tools.player, discovery.maker
    return {
        "simulated": [player.simulated, maker.simulated],
        "kept": [[motion.name for motion in each.kept] for each in discovery.sides],
        "turns": [each.search.turn for each in discovery.sides],
        "sides": [{name: getattr(each, name) for name in COUNTS} for each in discovery.sides],
    }


def _restore_counts(
    discovery: ChainDiscovery, counts: dict[str, Any], load: Callable[[str], Motion]
) -> None:
    for each, names in zip(discovery.sides, counts["kept"], strict=True):
        each.kept = [load(name) for name in names]
    discovery.tools.player.simulated, discovery.maker.simulated = counts["simulated"]
    for each, turn, row in zip(discovery.sides, counts["turns"], counts["sides"], strict=True):
        each.search.turn = turn
        for name in COUNTS:
            setattr(each, name, row[name])


def _pad(rows: Sequence[Sequence[int]]) -> np.ndarray:
    """Make one array of rows of numbers, the short ones filled up with `NOTHING`."""
    width = max((len(row) for row in rows), default=0)
    padded = [[*row, *[NOTHING] * (width - len(row))] for row in rows]
    return np.array(padded, dtype=int).reshape(len(rows), width)
