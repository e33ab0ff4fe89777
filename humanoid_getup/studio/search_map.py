"""Search map: the resting postures that a search for motions has reached, and the way to each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.judging.standing import MAX_TILT, MIN_NECK_SHARE
from humanoid_getup.experiments.starts.falls import UNCLASSED, classify
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.search_motions import MotionSearch
from humanoid_getup.posture_chains.features import StandFeatures, StandMeter
from humanoid_getup.posture_chains.resting_state import RestingState
from humanoid_getup.posture_chains.rise_kind import ON_SOLES, PASSING, KindNamer
from humanoid_getup.posture_chains.search_file import StoredOptions, read_states
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

WAY_UP = "way up"
"""In the place of a side: the state leads to the stance, and is not reached from lying yet."""
STAND, UNNAMED = "stand", "other posture"


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedState:
    """A posture in which the robot rests, and its way: from lying, or up to the stance."""

    side: str
    """Side from which it was reached, or `WAY_UP`."""
    posture: str
    """What it is called, such as "kneel"."""
    tilt: float
    """Angle between the torso's z axis and the vertical [rad]."""
    stands: bool
    """Whether it is upright on its soles, as high as a stand is."""
    qpos: Array
    """MuJoCo positions along its way, (moves + 1, nq)."""
    neck: Array
    """Neck heights there, as shares of that of the stance, (moves + 1,)."""
    front: Array
    """How far the front of the torso points up there, from prone to supine [rad], (moves + 1,)."""
    kinds: tuple[str, ...]
    """How each move was drawn, such as "limb", (moves,)."""

    @property
    def moves(self) -> int:
        """Return the number of moves of its way."""
        return len(self.kinds)

    @property
    def row(self) -> int:
        """Return the row of its way at which it is: the first one of a way up, else the last."""
        return 0 if self.side == WAY_UP else self.moves

    def __str__(self) -> str:
        way = "to the stance" if self.side == WAY_UP else f"from {self.side}"
        moves = "1 move" if self.moves == 1 else f"{self.moves} moves"
        return (
            f"{self.posture}: neck at {self.neck[self.row]:.0%} of standing, torso tilted by "
            f"{np.degrees(self.tilt):.0f}°, {moves} {way}"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchMap:
    """All states that a search has filed."""

    states: tuple[MappedState, ...]
    simulated: float
    """[s]"""
    options: StoredOptions

    def __str__(self) -> str:
        sides = dict.fromkeys(state.side for state in self.states)
        counts = [f"{side} {sum(s.side == side for s in self.states)}" for side in sides]
        return (
            f"{len(self.states)} states ({', '.join(counts)}) after {self.simulated:,.0f} s "
            f"simulated, seed {self.options.seed}"
        )


def read_search_map(world: World) -> SearchMap | None:
    """Read the states of a robot's search that is not done; None without one.

    Args:
        world: The robot on level ground, as it is searched.

    Raises:
        BadInputError: if the file is damaged, or of another version of the robot.
    """
    path = MotionSearch.file(world.robot)
    if not path.exists():
        return None
    with refusing():
        filed = read_states(path, world)
    ways = list[tuple[str, list[RestingState]]]()
    for archive in filed.sides:
        side = _find_side(world, archive[0].path[0])
        ways += [(side, state.path) for state in archive]
    ways += [(WAY_UP, _list_up(state)) for state in filed.ways_up]
    return SearchMap(
        states=_Surveyor(world, [way for _, way in ways]).map_all([side for side, _ in ways]),
        simulated=filed.simulated,
        options=filed.options,
    )


def _list_up(state: RestingState) -> list[RestingState]:
    """List the states from one with a way up to the stance."""
    states = [state]
    while (after := states[-1].after) is not None:
        states.append(after)
    return states


def _find_side(world: World, start: RestingState) -> str:
    """Find the side of a search by the posture in which it began."""
    return classify(start.qpos[world.robot.layout(world.model).root_orientation]) or UNCLASSED


class _Surveyor:
    """Measures all states of some ways once."""

    def __init__(self, world: World, ways: Sequence[Sequence[RestingState]]) -> None:
        self._ways = ways
        self._rows: dict[RestingState, int] = {}
        for state in (state for way in ways for state in way):
            self._rows.setdefault(state, len(self._rows))
        self._qpos = np.array([state.qpos for state in self._rows])
        self._features: StandFeatures = StandMeter(world).measure(self._qpos)
        self._names = KindNamer(world).list_names(self._qpos)

    def map_all(self, sides: Sequence[str]) -> tuple[MappedState, ...]:
        """Map the state of each way, which has a side."""
        return tuple(map(self._map, sides, self._ways))

    def _map(self, side: str, way: Sequence[RestingState]) -> MappedState:
        features, rows = self._features, [self._rows[state] for state in way]
        own = rows[0] if side == WAY_UP else rows[-1]
        moves = [state.onward for state in way[:-1]]
        if side != WAY_UP:
            moves = [state.move for state in way[1:]]
        neck, tilt = features.neck[rows], float(np.arccos(np.clip(features.up[own, 2], -1.0, 1.0)))
        is_high = features.neck[own] >= MIN_NECK_SHARE and features.flatness[own] > ON_SOLES
        stands, name = bool(is_high and tilt <= MAX_TILT), self._names[own]
        return MappedState(
            side=side,
            posture=STAND if stands else UNNAMED if name == PASSING else name,
            tilt=tilt,
            stands=stands,
            qpos=self._qpos[rows],
            neck=neck,
            front=np.arcsin(np.clip(features.up[rows, 0], -1.0, 1.0)),
            kinds=tuple("" if move is None else move.kind for move in moves),
        )
