"""Stored states: the resting states of a search's file, and the moves that link them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.posture_chains.goal import Goal
from humanoid_getup.posture_chains.resting_state import PostureMove, RestingState
from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from robots.storage.arrays import load_arrays, save_arrays, to_numbers
from robots.storage.validation import reading

STATES = ("qpos", "arrivals", "target", "cell", "progress", "place", "links", "depth")
MOVES = ("knots", "knot_count", "duration", "kind")
MEMBERS = "members"
"""Name of the array that lists the states of each archive."""
NOTHING = -1
MOST_MOVES = 300  # of a way; after 100,000 s of a search, ways had up to 17
UNIT = 1e-3  # by which the length of a quaternion may differ from 1


class NumberedStates:
    """Numbers states and moves, and writes them as arrays."""

    def __init__(self) -> None:
        self._states: dict[RestingState | None, int] = {None: NOTHING}
        self._moves: dict[PostureMove | None, int] = {None: NOTHING}

    def __contains__(self, state: RestingState) -> bool:
        return state in self._states

    def number(self, state: RestingState) -> int:
        """Number a state after all to which it leads."""
        todo = [state]
        while todo:
            last = todo[-1]
            if new := [link for link in (last.before, last.after) if link not in self._states]:
                todo += [link for link in new if link is not None]
                continue
            self._states.setdefault(last, len(self._states) - 1)
            todo.pop()
        return self._states[state]

    def number_move(self, move: PostureMove | None) -> int:
        """Number a move; `NOTHING` for None."""
        return self._moves.setdefault(move, len(self._moves) - 1)

    def write(self, n: int, worlds: int) -> dict[str, Any]:
        """Write the states of a robot with n joints, with their arrivals in so many worlds."""
        states = [state for state in self._states if state is not None]
        links = [
            [
                self._states[state.before],
                self._states[state.after],
                self.number_move(state.move),
                self.number_move(state.onward),
            ]
            for state in states
        ]
        moves = [move for move in self._moves if move is not None]
        plain = ("qpos", "target", "cell", "progress", "place", "depth")
        return {
            **{key: np.array([getattr(state, key) for state in states]) for key in plain},
            "arrivals": np.array([state.list_arrivals(worlds) for state in states]),
            "links": np.array(links, dtype=int),
            "knots": np.concatenate([np.zeros((0, n)), *(move.knots for move in moves)]),
            "knot_count": np.array([len(move.knots) for move in moves], dtype=int),
            "duration": np.array([move.duration for move in moves], dtype=float),
            "kind": np.array([move.kind for move in moves], dtype=str),
        }


def pad(rows: Sequence[Sequence[int]]) -> np.ndarray:
    """Make one array of rows of numbers, the short ones filled up with `NOTHING`."""
    width = max((len(row) for row in rows), default=0)
    padded = [[*row, *[NOTHING] * (width - len(row))] for row in rows]
    return np.array(padded, dtype=int).reshape(len(rows), width)


class StoredStates:
    """Moves and resting states of a search, checked against the world in which it searches."""

    def __init__(self, arrays: dict[str, Any], world: World, goal: Goal, worlds: int) -> None:
        """Read the arrays of a file of a search that checks its states in so many worlds."""
        self._arrays, self._world, self._goal, self._others = arrays, world, goal, worlds - 1
        self.moves = self._read_moves()
        self.states = self._read_states()

    def read_numbers(
        self, key: str, shape: tuple[int | None, ...], below: float
    ) -> NDArray[np.int_]:
        """Read whole numbers from `NOTHING` to one below which they have to be."""
        numbers = to_numbers(self._arrays[key], key, shape)
        wrong = (numbers < NOTHING) | (numbers >= below) | (numbers != np.round(numbers))
        if wrong.any():
            raise ValueError(
                f"{key} holds {numbers[wrong][0]:g}, expected a whole number from {NOTHING}, below "
                f"{below:g}"
            )
        return numbers.astype(np.int_)

    def read_archives(self, count: int) -> list[list[RestingState]]:
        """Read the states of each archive: of ways up, then of each side."""
        members = self.read_numbers(MEMBERS, (count, None), len(self.states))
        archives = [[self.states[k] for k in row if k != NOTHING] for row in members]
        if not all(archives):
            raise ValueError(f"{MEMBERS} holds an archive without states")
        return archives

    def _check_angles(self, key: str, angles: Array) -> None:
        """Refuse targets beyond the joints' ranges [rad], (K, n)."""
        robot = self._world.robot
        beyond = np.maximum(robot.lower - angles, angles - robot.upper)
        if np.any(beyond > UNIT):
            wrong = angles.flat[int(beyond.argmax())]
            raise ValueError(f"{key} holds {wrong:g} rad, expected angles in the joints' ranges")

    def _read_moves(self) -> list[PostureMove]:
        arrays = self._arrays
        n = self._world.robot.n
        knots = to_numbers(arrays["knots"], "knots", (None, n))
        count = self.read_numbers("knot_count", (None,), np.inf)
        duration, ends = to_numbers(arrays["duration"], "duration", count.shape), np.cumsum(count)
        if np.any(count < 1) or np.any(duration <= 0.0):
            raise ValueError("a move has no knots, or takes no time")
        self._check_angles("knots", knots)
        if len(ends) and ends[-1] != len(knots):
            raise ValueError(f"knots has {len(knots)} rows, expected {ends[-1]}")
        parts = np.split(knots, ends[:-1]) if len(ends) else []
        rows = zip(parts, duration, arrays["kind"], strict=True)
        return [
            PostureMove(knots=part, duration=float(time), kind=str(kind))
            for part, time, kind in rows
        ]

    def _read_states(self) -> list[RestingState]:
        arrays, world = self._arrays, self._world
        qpos = to_numbers(arrays["qpos"], "qpos", (None, world.model.nq))
        arrivals = to_numbers(
            arrays["arrivals"], "arrivals", (len(qpos), self._others, world.model.nq)
        )
        target = to_numbers(arrays["target"], "target", (len(qpos), world.robot.n))
        self._check_angles("target", target)
        root = world.robot.layout(world.model).root_orientation
        for key, positions in (("qpos", qpos), ("arrivals", arrivals)):
            if np.any(np.abs(np.linalg.norm(positions[..., root], axis=-1) - 1.0) > UNIT):
                raise ValueError(f"{key} holds a quaternion of another length than 1")
        goal = self._goal.meter.measure(self._goal.qpos[None])
        progress = to_numbers(arrays["progress"], "progress", (len(qpos),))
        if np.any(progress > 1.0 + UNIT):
            raise ValueError(f"progress holds {progress.max():g}, expected at most 1")
        where = to_numbers(arrays["place"], "place", (len(qpos), goal.places.shape[1]))
        cell = to_numbers(arrays["cell"], "cell", (len(qpos), goal.cells.shape[1])).astype(int)
        depth = self.read_numbers("depth", (len(qpos),), np.inf)
        links = self.read_numbers("links", (len(qpos), 4), max(len(qpos), len(self.moves)))
        states, moves = dict[int, RestingState](), dict(enumerate(self.moves))
        lengths = {NOTHING: -1}
        for k, (before, after, move, onward) in enumerate(links.tolist()):
            if max(before, after) >= k:
                raise ValueError(f"state {k} leads to one after it")
            lengths[k] = max(lengths[before], lengths[after]) + 1
            if lengths[k] > MOST_MOVES:
                raise ValueError(f"state {k} is over {MOST_MOVES} moves long, expected fewer")
            states[k] = RestingState(
                qpos=qpos[k],
                arrivals=arrivals[k],
                target=target[k],
                cell=tuple(cell[k].tolist()),
                progress=float(progress[k]),
                place=where[k],
                before=states.get(before),
                after=states.get(after),
                move=moves.get(move),
                onward=moves.get(onward),
                depth=int(depth[k]),
            )
        return [*states.values()]


WAYS_FOLDER = "slopes"
"""Of a robot's folder, with files of states from which it is known to get up on slopes."""


def find_ways(world: World) -> Path | None:
    """Return the file of the ways up on the slope of a world; None on level ground.

    It is for the robot's original body.
    """
    degrees = round(math.degrees(world.scene.slope), 3)
    if not degrees or not world.robot.body.is_original:
        return None
    return world.robot.folder / WAYS_FOLDER / f"{degrees:g}.npz"


def save_ways(file: Path, ways: Iterable[RestingState], world: World) -> None:
    """Write states with a way up."""
    numbers = NumberedStates()
    rows = [numbers.number(state) for state in ways]
    file.parent.mkdir(exist_ok=True)
    save_arrays(file, {**numbers.write(world.robot.n, 1), MEMBERS: pad([rows])})


def load_ways(world: World, goal: Goal) -> list[RestingState]:
    """Load the states with a way up on the slope of a world; none if none are stored."""
    file = find_ways(world)
    if file is None or not file.exists():
        return []
    with reading(f"ways up {file}", advice="; delete it to search from scratch"):
        arrays = load_arrays(file, (*STATES, *MOVES, MEMBERS))
        archives = StoredStates(arrays, world, goal, 2).read_archives(1)
    return archives[0]
