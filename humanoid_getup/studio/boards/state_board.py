"""State board: the states of a search as a map upright in the scene, each of them to click."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from humanoid_getup.studio.boards.plot_board import AXES, LEVEL, WIDTH, PlotBoard, join
from humanoid_getup.studio.boards.state_colors import ROWS, Color, StateColors
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser

    from humanoid_getup.studio.search_map import MappedState

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

        Args:
            server: Server of the page.
            size: Standing neck height of the robot [m].
            chosen: Called with the number of a state that is clicked.
            answer: Makes a callback of the page.
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
        steps = [_pick_step(self._locate(state), state.row) for state in states if state.moves]
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


def _pick_step(spots: Array, row: int) -> Array:
    """Pick the move of a way, (moves + 1, 3), that its state at a row has added, (2, 3)."""
    first = max(row - 1, 0)
    return spots[first : first + 2]
