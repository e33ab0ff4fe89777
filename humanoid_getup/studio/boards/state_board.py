"""State board: the states of a search as a map upright in the scene, each of them to click."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.motions.search_motions import MotionSearch
from humanoid_getup.experiments.falls import UNCLASSED, classify
from humanoid_getup.experiments.judging.standing import MAX_TILT, MIN_NECK_SHARE
from humanoid_getup.posture_chains.features import StandFeatures, StandMeter
from humanoid_getup.posture_chains.resting_state import RestingState
from humanoid_getup.posture_chains.rise_kind import ON_SOLES, PASSING, KindNamer
from humanoid_getup.posture_chains.search_file import StoredOptions, read_states
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.boards.plot_board import AXES, LEVEL, WIDTH, PlotBoard, join
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser

WAY_UP = "way up"
"""In the place of a side: the state leads to the stance, and is not reached from lying yet."""
STAND, UNNAMED = "stand", "other posture"
Color = tuple[int, int, int]
SCALE: tuple[Color, ...] = ((253, 210, 60), (240, 120, 60), (170, 50, 120), (60, 15, 110))
"""From no move to the most."""
SIDES: tuple[Color, ...] = (
    (47, 111, 222),
    (217, 130, 43),
    (44, 160, 44),
    (148, 103, 189),
    (120, 120, 120),
)
ROWS = 5
"""Number of rows of a key, at most."""
ROOT = "/discovery"
NECK = "Neck height [share of standing]"
FRONT = "Front of the torso [deg over the horizon]"
NECK_TICKS = ((0.0, "0"), (0.5, "0.5"), (1.0, "1"))
FRONT_TICKS = ((-90.0, "-90° prone"), (0.0, "0° upright, or on a side"), (90.0, "90° supine"))
MOVE, WAY = (205, 205, 205), (214, 39, 40)
# Sizes in standing neck heights.
HEIGHT, BASE, HIGHEST = 1.75, 1.0, 1.1
"""The last one is the share of standing at the upper edge."""
STATE, CHOSEN = 0.02, 0.034  # radii
BEFORE = 0.01  # from the lines to the way that is stressed
KEY_GAP, KEY_ROW = 0.1, 0.12  # of the key of colors: from its dots to their labels; of its rows


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
    """Read the states of a search that is not done, on level ground; None without one."""
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
    surveyor = _Surveyor(world, [way for _, way in ways])
    return SearchMap(
        states=tuple(surveyor.map(side, way) for side, way in ways),
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
        self._rows: dict[RestingState, int] = {}
        for state in (state for way in ways for state in way):
            self._rows.setdefault(state, len(self._rows))
        self._qpos = np.array([state.qpos for state in self._rows])
        self._features: StandFeatures = StandMeter(world).measure(self._qpos)
        self._names = KindNamer(world).list_names(self._qpos)

    def map(self, side: str, way: Sequence[RestingState]) -> MappedState:
        """Map the state of a way, which has a side."""
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


@dataclass(frozen=True, kw_only=True, eq=False)
class StateColors:
    """Colors of states, and what they mean."""

    colors: Array
    """From 0 to 255, (S, 3)."""
    key: tuple[tuple[Color, str], ...]


def color_by_moves(states: Sequence[MappedState]) -> StateColors:
    """Color states by the number of moves of their ways."""
    moves = np.array([state.moves for state in states])
    most = max(int(moves.max(initial=0)), 1)
    shown = np.unique(np.linspace(0, most, ROWS).round())
    texts = [f"{number:.0f} moves" for number in shown]
    return StateColors(
        colors=_blend(moves / most),
        key=tuple(zip(map(_to_color, _blend(shown / most)), texts, strict=True)),
    )


def color_by_side(states: Sequence[MappedState], sides: Sequence[str]) -> StateColors:
    """Color states by their sides, of which there are some; at most as many as colors."""
    color = dict(zip(sides, SIDES, strict=False))
    present = {state.side for state in states}
    return StateColors(
        colors=np.array([color[state.side] for state in states]),
        key=tuple((color[side], side) for side in sides if side in present),
    )


def _blend(share: Array) -> Array:
    """Blend the colors of the scale at shares from 0 to 1, (S,); return them, (S, 3)."""
    at = np.linspace(0.0, 1.0, len(SCALE))
    return np.stack([np.interp(share, at, channel) for channel in np.array(SCALE).T], axis=-1)


def _to_color(channels: Array) -> Color:
    red, green, blue = channels.astype(int).tolist()
    return red, green, blue


class StateBoard(PlotBoard):
    """Neck height against the attitude of the torso: from lying, below, to a stand, above.

    Prone and supine are to the left and right; a robot that is upright, or lies on a side, is in
    the middle. Lines are moves between states.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        size: float,
        chosen: Callable[[int], None],
        answer: Callable[[Callable[[], None]], Callable[[object], None]],
    ) -> None:
        """Add a hidden board, for a robot of a standing neck height [m].

        ``chosen`` gets the number of a state that is clicked.
        """
        super().__init__(server, ROOT, size)
        self._chosen, self._answer = chosen, answer
        self._dots: viser.BatchedMeshHandle | None = None
        self._add_axes()
        self._moves = self._add_line("moves", np.zeros((1, 2, 3)), MOVE, 1.0)
        self._way = self._add_line("way", np.zeros((1, 2, 3)), WAY, 4.0)
        self._stress = self._scene.add_icosphere(
            f"{ROOT}/chosen", CHOSEN * size, WAY, cast_shadow=False, receive_shadow=False
        )
        self._keys = [self._add_key(row) for row in range(ROWS)]
        self.stress(None)

    def show(self, states: Sequence[MappedState], colored: StateColors) -> None:
        """Draw states in colors, and the moves that lead to them or up from them."""
        spots = np.array([self._locate(state)[state.row] for state in states]).reshape(-1, 3)
        if self._dots is not None:
            self._dots.remove()
        self._dots = self._add_dots(spots, colored.colors) if len(states) else None
        # Of each way, the move that its state has added.
        steps = [self._locate(s)[max(s.row - 1, 0) :][:2] for s in states if s.moves]
        self._moves.visible = bool(steps)
        if steps:
            self._moves.points = np.array(steps)
        self._show_key(colored.key)

    def stress(self, state: MappedState | None) -> None:
        """Stress a state and its way; None for none."""
        self._stress.visible = state is not None
        self._way.visible = state is not None and state.moves > 0
        if state is None:
            return
        spots = self._locate(state) - np.array([0.0, BEFORE * self._size, 0.0])
        self._stress.position = spots[state.row]
        if state.moves:
            self._way.points = join(spots)

    def find_spot(self, state: MappedState) -> Array:
        """Return where a state is in the world [m], (3,)."""
        return self._to_world(self._locate(state)[state.row])

    # Geometry in the board's frame, x along the attitude -----------------------------------------

    def _locate(self, state: MappedState) -> Array:
        """Compute where the postures of a state's way are, (moves + 1, 3)."""
        return self._find(np.degrees(state.front), state.neck)

    def _find(self, front: Any, neck: Any) -> Array:
        """Compute where attitudes [deg] and neck heights (T,) are, (T, 3)."""
        front, neck = np.broadcast_arrays(np.asarray(front, float), np.asarray(neck, float))
        up = BASE + HEIGHT * np.clip(neck, 0.0, HIGHEST) / HIGHEST
        return self._size * np.stack([front / 180.0 * WIDTH, np.zeros_like(up), up], axis=-1)

    # Drawing -------------------------------------------------------------------------------------

    def _add_axes(self) -> None:
        edges = self._find([-90.0, -90.0, 90.0], [HIGHEST, 0.0, 0.0])
        self._add_line("axes", join(edges), AXES, 2.0)
        self._add_line("stand", join(self._find([-90.0, 90.0], 1.0)), LEVEL, 1.5)
        self._add_line("upright", join(self._find(0.0, [0.0, HIGHEST])), LEVEL, 1.5)
        self._add_label("neck", NECK, 0.02, BASE + HEIGHT + 0.02, "bottom-left")
        self._add_label("front", FRONT, 0.5 * WIDTH, BASE - 0.17, "top-center")
        for value, text in NECK_TICKS:
            up = BASE + HEIGHT * value / HIGHEST
            self._add_label(f"neck {text}", text, -0.05, up, "center-right")
        for value, text in FRONT_TICKS:
            across = (value / 180.0 + 0.5) * WIDTH
            self._add_label(f"front {text}", text, across, BASE - 0.04, "top-center")

    def _add_dots(self, spots: Array, colors: Array) -> viser.BatchedMeshHandle:
        ball = trimesh.creation.icosphere(subdivisions=1, radius=STATE * self._size)
        dots = self._scene.add_batched_meshes_simple(
            f"{ROOT}/states",
            np.asarray(ball.vertices, np.float32),
            np.asarray(ball.faces, np.uint32),
            np.tile([1.0, 0.0, 0.0, 0.0], (len(spots), 1)),
            spots,
            batched_colors=colors.astype(np.uint8),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

        @dots.on_click
        def choose(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
            if (number := event.instance_index) is not None:
                self._answer(lambda: self._chosen(number))(event)

        return dots

    def _show_key(self, rows: Sequence[tuple[Color, str]]) -> None:
        for number, (dot, label) in enumerate(self._keys):
            dot.visible = label.visible = number < len(rows)
            if number < len(rows):
                dot.color, label.text = rows[number]

    def _add_key(self, row: int) -> tuple[viser.IcosphereHandle, Any]:
        """Add a hidden row of the key of colors, right of the map."""
        across, up = WIDTH + KEY_GAP, BASE + HEIGHT - KEY_ROW * (row + 1)
        dot = self._scene.add_icosphere(
            f"{ROOT}/key_{row}", CHOSEN * self._size, cast_shadow=False, receive_shadow=False
        )
        dot.position = self._size * np.array([across - 0.5 * WIDTH, 0.0, up])
        dot.visible = False
        label = self._add_label(f"key_{row}_label", "", across + KEY_GAP, up, "center-left")
        return dot, label
