"""Curve board: style curves upright in the scene, with control points that are dragged."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from humanoid_getup.studio.takes import TITLES
from humanoid_getup.style.curves import HIGHEST_VALUES, PLACES, POINTS, UPRIGHT_STAND, StyleCurves
from humanoid_getup.style.style_editor import clip_value
from robots import quaternion
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser

ROOT = "/style"
TICKS: tuple[tuple[tuple[float, str], ...], ...] = (
    ((0.0, "0"), (1.0, "1")),
    *2 * (((0.0, "0°"), (math.pi / 2, "90°"), (math.pi, "180°")),),
)
AXES, LEVEL = (90, 90, 90), (185, 185, 185)
COLORS = ((47, 111, 222), (217, 130, 43), (44, 160, 44))
FOLLOWED = (40, 40, 40)
SAMPLES = 97  # of a curve
# Sizes in standing neck heights.
WIDTH, HEIGHT, GAP, BASE = 2.3, 0.6, 0.26, 0.75
TEXT = 0.095
POINT, CHOSEN_POINT = 0.032, 1.5  # radius of a control point; factor on that of the chosen one
BEHIND = 1.2  # from the robot to the board
FACING = math.atan2(-1.6, 1.9)  # direction in which the board faces, that of the first camera
CAMERA_AWAY, CAMERA_HEIGHT, CAMERA_AIM = 3.8, 2.0, 1.4


@dataclass(frozen=True, kw_only=True)
class PointDrag:
    """A control point that is dragged."""

    feature: int
    point: int
    value: float
    """Value at the pointer, as a share of standing, or [rad]; within what points may have."""
    released: bool
    """Whether the drag ends with it."""


class CurveBoard:
    """Three plots, one above the other, whose control points move along their values.

    The lines of what a robot has followed lie over the curves. The board stands upright behind the
    robot. Its frame has x to the right, z up and y away from the viewer; places on it are in
    standing neck heights, from the middle of its lower edge on the ground.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        size: float,
        dragged: Callable[[PointDrag], None],
        answer: Callable[[Callable[[], None]], Callable[[object], None]],
    ) -> None:
        """Add a hidden board, for a robot of a standing neck height [m].

        ``dragged`` gets drags, in order; of several that wait, the newest counts.
        """
        self._server, self._scene, self._size = server, server.scene, size
        self._place = np.zeros(3)
        turn = quaternion.from_yaw(FACING + math.pi / 2)
        self._R = quaternion.to_matrix(turn)
        self._root = self._scene.add_frame(ROOT, show_axes=False, visible=False, wxyz=turn)
        self._dragged, self._answer = dragged, answer
        self._drags: deque[PointDrag] = deque()
        self._grips: dict[tuple[int, int], float] = {}
        """From the pointer to the value of each point that is dragged."""
        self._values = np.zeros((POINTS, 3))
        self._lines = [self._add_plot(feature) for feature in range(3)]
        self._points = [
            [self._add_point(feature, point) for point in range(POINTS)] for feature in range(3)
        ]
        self._end = self._add_label("end", "", WIDTH, BASE, "top-center")

    def place(self, position: Array) -> None:
        """Place it behind a robot at a position [m], (3,)."""
        self._place = [*position[:2], 0.0] + self._R @ [0.0, BEHIND * self._size, 0.0]
        self._root.position = self._place

    @property
    def viewpoint(self) -> Array:
        """Return from where it is looked at, with the robot in front of it [m], (3,)."""
        return self._place + self._R @ (self._size * np.array([0.0, -CAMERA_AWAY, CAMERA_HEIGHT]))

    def hide(self) -> None:
        """Hide it."""
        self._root.visible = False

    def put_up(self, position: Array) -> None:
        """Show it behind a robot at a position [m], (3,), and let every browser look at it."""
        self.place(position)
        self._root.visible = True
        for client in self._server.get_clients().values():
            client.camera.position = self.viewpoint
            client.camera.look_at = self._place + np.array([0.0, 0.0, CAMERA_AIM * self._size])

    def show(self, curves: StyleCurves, chosen: tuple[int, int] | None = None) -> None:
        """Draw curves and their control points; ``chosen`` is the feature and point to stress."""
        self._values = curves.points
        self._end.text = f"{curves.duration:.2f} s"
        samples = curves.sample(np.linspace(0.0, curves.duration, SAMPLES))
        share = np.linspace(0.0, 1.0, SAMPLES)
        for feature, (line, _) in enumerate(self._lines):
            line.points = _join(self._locate(feature, share, samples[:, feature]))
            spots = self._locate(feature, PLACES, curves.points[:, feature])
            for point, handle in enumerate(self._points[feature]):
                handle.position = spots[point]
                handle.scale = CHOSEN_POINT if (feature, point) == chosen else 1.0

    def show_followed(self, time: Array, features: Array, duration: float) -> None:
        """Draw what a robot has followed: features (T, 3) at times (T,) [s], up to a duration."""
        kept = np.flatnonzero(time <= duration)
        kept = kept[:: max(1, len(kept) // SAMPLES)]
        if len(kept) < 2:
            return self.hide_followed()
        for feature, (_, line) in enumerate(self._lines):
            values = np.clip(features[kept, feature], 0.0, HIGHEST_VALUES[feature])
            line.points = _join(self._locate(feature, time[kept] / duration, values))
            line.visible = True
        return None

    def hide_followed(self) -> None:
        """Draw nothing that was followed."""
        for _, line in self._lines:
            line.visible = False

    def find_point(self, feature: int, point: int) -> Array:
        """Return where a control point is in the world [m], (3,)."""
        return self._place + self._R @ self._points[feature][point].position

    def find_spot(self, feature: int, point: int, value: float) -> Array:
        """Return where a control point of a value is in the world [m], (3,)."""
        spots = self._locate(feature, PLACES[[point]], np.array([value]))
        return self._place + self._R @ spots[0]

    # Geometry in the board's frame, x along time ------------------------------------------------

    def _locate(self, feature: int, share: Array, values: Array) -> Array:
        """Compute where values (T,) at shares (T,) of the duration are, (T, 3)."""
        base = BASE + (2 - feature) * (HEIGHT + GAP)
        up = base + HEIGHT * values / HIGHEST_VALUES[feature]
        across = (share - 0.5) * WIDTH
        return self._size * np.stack([across, np.zeros_like(up), up], axis=-1)

    def _find_value(self, feature: int, camera: Array, target: Array) -> float:
        """Compute the value where the ray from a camera through a target meets the board."""
        a, b = ((point - self._place) @ self._R for point in (camera, target))
        run = a[1] - b[1]
        z = a[2] + (b[2] - a[2]) * (a[1] / run) if abs(run) > 1e-6 * self._size else b[2]
        base = self._locate(feature, np.zeros(1), np.zeros(1))[0, 2]
        return float((z - base) / (self._size * HEIGHT) * HIGHEST_VALUES[feature])

    # Drawing -----------------------------------------------------------------------------------

    def _add_plot(self, feature: int) -> tuple[Any, Any]:
        """Add axes, labels and lines of a feature; return the lines of curve and followed."""
        top = float(HIGHEST_VALUES[feature])
        axes = _join(self._locate(feature, np.array([0.0, 0.0, 1.0]), np.array([top, 0.0, 0.0])))
        self._add_line(f"{feature}/axes", axes, AXES, 2.0)
        stand = np.full(2, UPRIGHT_STAND[feature])
        level = _join(self._locate(feature, np.array([0.0, 1.0]), stand))
        self._add_line(f"{feature}/stand", level, LEVEL, 1.5)
        over = self._locate(feature, np.zeros(1), np.array([top]))[0, 2] / self._size
        self._add_label(f"{feature}/name", TITLES[feature], 0.02, over + 0.02, "bottom-left")
        for value, text in TICKS[feature]:
            up = self._locate(feature, np.zeros(1), np.array([value]))[0, 2] / self._size
            self._add_label(f"{feature}/{text}", text, -0.05, up, "center-right")
        followed = self._add_line(f"{feature}/followed", np.zeros((1, 2, 3)), FOLLOWED, 2.0)
        followed.visible = False
        curve = self._add_line(f"{feature}/curve", np.zeros((1, 2, 3)), COLORS[feature], 4.0)
        return curve, followed

    def _add_line(
        self, name: str, points: Array, color: tuple[int, int, int], pixels: float
    ) -> Any:
        """Add segments (K, 2, 3) in the board's frame [m]."""
        return self._scene.add_line_segments(
            f"{ROOT}/{name}", points, color, thickness=pixels, thickness_units="screen"
        )

    def _add_label(self, name: str, text: str, x: float, z: float, anchor: Any) -> Any:
        """Add a text at a place from the lower left corner [neck heights]."""
        return self._scene.add_label(
            f"{ROOT}/{name}",
            text,
            position=self._size * np.array([x - 0.5 * WIDTH, 0.0, z]),
            font_size_mode="scene",
            font_scene_height=TEXT * self._size,
            anchor=anchor,
        )

    def _add_point(self, feature: int, point: int) -> viser.IcosphereHandle:
        handle = self._scene.add_icosphere(
            f"{ROOT}/{feature}/point_{point}",
            POINT * self._size,
            COLORS[feature],
            cast_shadow=False,
            receive_shadow=False,
        )

        @handle.on_drag
        async def follow(event: viser.SceneNodeDragEvent[viser.IcosphereHandle]) -> None:
            self._follow(feature, point, event)
            asyncio.get_running_loop().run_in_executor(None, self._answer(self._take_drags), None)

        return handle

    # Drags -------------------------------------------------------------------------------------

    def _follow(
        self, feature: int, point: int, event: viser.SceneNodeDragEvent[viser.IcosphereHandle]
    ) -> None:
        """Note where the pointer is, in the thread of the server."""
        camera, key = np.asarray(event.client.camera.position), (feature, point)
        if event.phase == "start" or key not in self._grips:
            grabbed = self._find_value(feature, camera, np.asarray(event.start_position))
            self._grips[key] = self._values[point, feature] - grabbed
        at = self._find_value(feature, camera, np.asarray(event.end_position))
        value = clip_value(feature, at + self._grips[key])
        released = event.phase == "end"
        if released:
            del self._grips[key]
        drag = PointDrag(feature=feature, point=point, value=value, released=released)
        self._drags.append(drag)

    def _take_drags(self) -> None:
        """Pass on the drags that wait, but for those that the next one replaces."""
        drags = [self._drags.popleft() for _ in range(len(self._drags))]
        for number, drag in enumerate(drags):
            if drag.released or number == len(drags) - 1:
                self._lift(drag)
                self._dragged(drag)

    def _lift(self, drag: PointDrag) -> None:
        """Move a control point to where it is dragged."""
        spots = self._locate(drag.feature, PLACES[[drag.point]], np.array([drag.value]))
        self._points[drag.feature][drag.point].position = spots[0]


def _join(points: Array) -> Array:
    """Make the segments (T - 1, 2, 3) of a line through points (T, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)
