"""Plot board: a plot that stands upright in the scene behind the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from humanoid_getup.studio.page import Page
from robots import quaternion
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser

AXES, LEVEL = (90, 90, 90), (185, 185, 185)
# Sizes in standing neck heights.
WIDTH = 2.3
TEXT = 0.095
BEHIND = 1.2  # from the robot to the board
FACING = math.atan2(-1.6, 1.9)  # direction in which the board faces, that of the first camera
CAMERA_DISTANCE, CAMERA_HEIGHT, CAMERA_AIM = 3.8, 2.0, 1.4


class PlotBoard:
    """Lines and labels in a frame of their own: x to the right, z up, y away from the viewer.

    Places on it are in standing neck heights, from the middle of its lower edge on the ground.
    """

    def __init__(self, server: viser.ViserServer, root: str, size: float) -> None:
        """Add a hidden board under a name, for a robot of a standing neck height [m]."""
        self._server, self._scene, self._name, self._size = server, server.scene, root, size
        self._place = np.zeros(3)
        turn = FACING + math.pi / 2
        self._R = np.array(
            [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
        )
        self._root = self._scene.add_frame(
            root, show_axes=False, visible=False, wxyz=quaternion.from_yaw(turn)
        )

    @property
    def visible(self) -> bool:
        """Return whether it is shown."""
        return self._root.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._root.visible = visible

    def place(self, position: Array) -> None:
        """Place it behind a robot at a position [m], (3,)."""
        away = BEHIND * self._size * np.array([math.cos(FACING), math.sin(FACING), 0.0])
        self._place = np.array([*position[:2], 0.0]) - away
        self._root.position = self._place

    @property
    def viewpoint(self) -> Array:
        """Return from where it is looked at, with the robot in front of it [m], (3,)."""
        out = np.array([math.cos(FACING), math.sin(FACING), 0.0])
        up = np.array([0.0, 0.0, CAMERA_HEIGHT])
        return self._place + self._size * (CAMERA_DISTANCE * out + up)

    def face(self) -> None:
        """Let every browser look at it."""
        for client in self._server.get_clients().values():
            client.camera.position = self.viewpoint
            client.camera.look_at = self._place + np.array([0.0, 0.0, CAMERA_AIM * self._size])

    def _to_world(self, spot: Array) -> Array:
        """Return where a point of the board's frame [m] is in the world [m], (3,) each."""
        return self._place + self._R @ np.asarray(spot)

    def _add_line(
        self, name: str, points: Array, color: tuple[int, int, int], pixels: float
    ) -> Any:
        """Add segments (K, 2, 3) in the board's frame [m]."""
        return self._scene.add_line_segments(
            f"{self._name}/{name}", points, color, thickness=pixels, thickness_units="screen"
        )

    def _add_label(self, name: str, text: str, x: float, z: float, anchor: Any) -> Any:
        """Add a text at a place from the lower left corner [neck heights]."""
        return self._scene.add_label(
            f"{self._name}/{name}",
            text,
            position=self._size * np.array([x - 0.5 * WIDTH, 0.0, z]),
            font_size_mode="scene",
            font_scene_height=TEXT * self._size,
            anchor=anchor,
        )


def join(points: Array) -> Array:
    """Make the segments (T - 1, 2, 3) of a line through points (T, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


class BoardSwitch:
    """A checkbox that shows a board, hides the one that was shown, and turns the camera to it."""

    def __init__(
        self, page: Page, label: str, board: PlotBoard, prepare: Callable[[], None] = lambda: None
    ) -> None:
        """Add it where the caller is adding elements; ``prepare`` is called before it is shown."""
        self._page, self._board, self._prepare = page, board, prepare
        self._box = page.gui.add_checkbox(label, False)
        page.on_change(self._box, self._turn)

    def show(self) -> None:
        """Show the board, behind the posture of the page."""
        self._prepare()
        self._page.hide_board()
        self._page.hide_board = self.hide
        self._box.value = self._board.visible = True
        self._board.place(self._page.start.position)
        self._board.face()

    def hide(self) -> None:
        """Hide the board."""
        self._box.value = self._board.visible = False

    def _turn(self) -> None:
        if not self._box.value:
            return self.hide()
        try:
            return self.show()
        except Exception:
            self.hide()
            raise
