"""Style curves: neck height and torso angles that a rise should have over time.

A feature curve is a cardinal cubic B-spline with nine control points ([Frezzato22], section 4.1),
equally apart in time and mirrored at both ends, where the curve is at rest. It stays within the
hull of its control points. A rise is held at its end (equation 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from humanoid_getup.clips.clip import Clip
from humanoid_getup.clips.joint_names import is_foot
from humanoid_getup.scenes.ground import FLAT, Ground, mean_height
from humanoid_getup.style.features import (
    AROUND,
    COUNT,
    angle_distance,
    mirror_features,
    torso_angles,
)
from robots import Robot, quaternion
from robots.kinematics import site_positions
from robots.quaternion import Array
from robots.smooth_step import smooth_step

SavedState = dict[str, Any]
"""State of an object by the names of its parts: arrays, numbers and states within it."""


class SavedArrays:
    """An object whose state is in some of its arrays."""

    saved: ClassVar[tuple[str, ...]]
    """Attributes that hold the state."""

    def save_state(self) -> SavedState:
        """Return a copy of the state, for :meth:`restore_state`."""
        return {name: getattr(self, name).copy() for name in self.saved}

    def restore_state(self, state: SavedState) -> None:
        """Restore a state of :meth:`save_state`."""
        for name in self.saved:
            setattr(self, name, state[name].copy())


POINTS = 9
PIECES = POINTS - 1
LOOKAHEAD = np.array([0.0, 0.1, 0.2, 0.3])  # s, of the targets that a policy observes
HIGHEST = 1.2  # share of the standing neck height; a robot on its toes stands higher than 1
HIGHEST_VALUES = np.array([HIGHEST, np.pi, np.pi])
"""Upper limits of the features; the lower ones are 0."""
# The neck height and the tilt [rad] of a stand, by which rises are judged.
LEAST_END, MOST_LEAN = 0.9, math.radians(15.0)
SHORTEST, LONGEST = 0.1, 60.0  # s
ROUNDING = 1e-6  # by which a limit may be missed
PLACES = np.linspace(0.0, 1.0, POINTS)
"""Share of the duration at each control point."""
UPRIGHT_STAND = np.array([1.0, math.pi / 2, math.pi / 2])
"""Features of a stand."""
EXTENDED = np.pad(np.eye(POINTS), ((1, 1), (0, 0)), mode="reflect")
VALUES = (EXTENDED[:-2] + 4.0 * EXTENDED[1:-1] + EXTENDED[2:]) / 6.0
"""From control points to the values at their times, (9, 9)."""
BASIS = np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 0, 3, 0], [1, 4, 1, 0]]) / 6.0
"""Cubic B-spline: from four control points to the polynomial between the middle two."""
BLEND_SHARE = 0.25  # of the duration, over which a curve is entered from where a robot lies


@dataclass(frozen=True, kw_only=True, eq=False)
class StyleCurves:
    """The style of a rise: its features over time."""

    neck_height: Array
    """Control points of the neck height, as a share of standing, (9,)."""
    side: Array
    """Control points of the angle between the torso's right side and the vertical [rad], (9,)."""
    front: Array
    """Control points of the angle between the torso's front and the vertical [rad], (9,)."""
    duration: float
    """[s]"""
    start: str = ""
    """How the body lies at the beginning, such as supine; for readers only."""
    pieces: Array = field(init=False, repr=False)
    """Polynomials between the control points, (8, 4, 3), highest power first; their variable is
    the share of the duration since the piece's own beginning."""

    def __post_init__(self) -> None:
        if problems := self._find_problems():
            raise ValueError("; ".join(problems))
        object.__setattr__(self, "pieces", _fit(self.points))

    @staticmethod
    def of(points: Array, duration: float, start: str = "") -> StyleCurves:
        """Make curves from control points, (9, 3), in the order of the features."""
        height, side, front = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        return StyleCurves(
            neck_height=height, side=side, front=front, duration=duration, start=start
        )

    @property
    def points(self) -> Array:
        """Return the control points, (9, 3), in the order of the features."""
        return np.stack([self.neck_height, self.side, self.front], axis=-1)

    @staticmethod
    def through(values: Array, duration: float, start: str = "") -> StyleCurves:
        """Make curves that have values (9, 3) at the times of their control points.

        A control point beyond what the features can have is clipped, and its curve misses there.
        """
        solved: Array = np.linalg.solve(VALUES, values).astype(float)
        points = np.clip(solved, 0.0, HIGHEST_VALUES)
        for end, inner in ((0, 1), (-1, -2)):  # both ends stay exact
            outer = 1.5 * values[end] - 0.5 * points[inner]
            points[end] = np.clip(outer, 0.0, HIGHEST_VALUES)
            points[inner] = 3.0 * values[end] - 2.0 * points[end]
        return StyleCurves.of(points, duration, start)

    @property
    def values(self) -> Array:
        """Return the features at the times of the control points, (9, 3)."""
        return VALUES @ self.points

    @property
    def turn(self) -> float:
        """Return the sum of the changes of both angles between the points' times [rad]."""
        return float(np.abs(np.diff(self.values[:, 1:], axis=0)).sum())

    def retimed(self, time: Array, duration: float) -> StyleCurves:
        """Return curves of a duration [s] through the values of these at nine times [s], (9,)."""
        return StyleCurves.through(self.sample(time), duration, self.start)

    def sample(self, time: Array) -> Array:
        """Compute the features (..., 3) at times [s], (...); a stand is held at the end."""
        share = np.clip(np.asarray(time, dtype=float) / self.duration, 0.0, 1.0)
        return evaluate(self.pieces[np.newaxis], share[np.newaxis])[0]

    def mirrored(self) -> StyleCurves:
        """Exchange left and right."""
        start = {"left": "right", "right": "left"}.get(self.start, self.start)
        return StyleCurves.of(mirror_features(self.points), self.duration, start)

    def lasting(self, duration: float) -> StyleCurves:
        """Return the same curves with another duration [s]."""
        return replace(self, duration=duration)

    def _find_problems(self) -> list[str]:
        problems = []
        for name, values, upper, unit in (
            ("neck_height", self.neck_height, HIGHEST, ""),
            ("side", np.degrees(self.side), 180.0, "°"),
            ("front", np.degrees(self.front), 180.0, "°"),
        ):
            if np.shape(values) != (POINTS,):
                problems.append(f"{name} has shape {np.shape(values)}, expected ({POINTS},)")
                continue
            is_inside = (values >= -ROUNDING) & (values <= upper + ROUNDING)
            wrong = np.flatnonzero(~is_inside)  # nan as well
            if len(wrong):
                problems.append(
                    f"{name} is {values[wrong[0]]:g}{unit} at point {wrong[0] + 1}, "
                    f"expected 0 to {upper:g}{unit}"
                )
        if not SHORTEST - ROUNDING <= self.duration <= LONGEST + ROUNDING:
            problems.append(
                f"duration is {self.duration:.6g} s, expected {SHORTEST:g} to {LONGEST:g} s"
            )
        return problems or self._find_problems_of_end()

    def _find_problems_of_end(self) -> list[str]:
        problems, (height, side, front) = [], self.values[-1]
        if height < LEAST_END - ROUNDING:
            problems.append(
                f"neck_height ends at {height:.4g} of standing, expected {LEAST_END:g} or more: a "
                "rise ends in a stand"
            )
        for name, value in (("side", side), ("front", front)):
            if abs(value - math.pi / 2) > MOST_LEAN + ROUNDING:
                problems.append(
                    f"{name} ends at {math.degrees(value):.4g}°, expected 75 to 105°: a rise ends "
                    "upright"
                )
        return problems


def is_stand(features: Array) -> NDArray[np.bool_]:
    """Return whether features (..., 3) are those of a stand, (...)."""
    lean = np.abs(features[..., 1:] - math.pi / 2).max(axis=-1)
    return (features[..., 0] >= LEAST_END - ROUNDING) & (lean <= MOST_LEAN + ROUNDING)


def _fit(points: Array) -> Array:
    """Convert control points (9, 3) to polynomials (8, 4, 3)."""
    around = sliding_window_view(EXTENDED @ points, 4, axis=0)  # (8, 3, 4)
    scale = float(PIECES) ** np.arange(3, -1, -1)
    return scale[:, np.newaxis] * (BASIS @ around.swapaxes(1, 2))


def evaluate(pieces: Array, share: Array) -> Array:
    """Evaluate curves (N, 8, 4, 3) at shares of their durations, (N, ...), as (N, ..., 3)."""
    at = np.clip((share * PIECES).astype(int), 0, PIECES - 1)
    rest = (share - at / PIECES)[..., np.newaxis]
    each = np.arange(len(pieces)).reshape(-1, *(1,) * (share.ndim - 1))
    c = pieces[each, at]  # (N, ..., 4, 3)
    return ((c[..., 0, :] * rest + c[..., 1, :]) * rest + c[..., 2, :]) * rest + c[..., 3, :]


class CurveTargets(SavedArrays):
    """The targets of N robots, each on curves of its own; one code for training and robot.

    Each curve is entered from the features that were measured: their difference from it fades
    within the first quarter of the time that is left.
    """

    saved = ("_pieces", "duration", "_entered", "_offset")

    def __init__(self, n: int) -> None:
        self._pieces = np.zeros((n, PIECES, 4, 3))
        self.duration = np.ones(n)
        """[s], (N,)"""
        self._entered = np.zeros(n)  # s
        self._offset = np.zeros((n, 3))

    def enter(
        self, ids: NDArray[np.int_], pieces: Array, duration: Array, measured: Array, time: Array
    ) -> None:
        """Start some robots at times on curves.

        Those of ``ids``, (m,), measure features (m, 3), and are on curves (m, 8, 4, 3) of whole
        durations [s], at times [s], (m,).
        """
        self._pieces[ids], self.duration[ids], self._entered[ids] = pieces, duration, time
        self._offset[ids] = measured - evaluate(pieces, np.clip(time / duration, 0.0, 1.0))

    def at(self, time: Array) -> Array:
        """Compute targets (N, ..., 3) at times on the curves [s], (N, ...)."""
        ahead = (slice(None), *(np.newaxis,) * (time.ndim - 1))
        duration, entered = self.duration[ahead], self._entered[ahead]
        blend = np.maximum(BLEND_SHARE * (duration - entered), 1e-3)
        fade = smooth_step(1.0 - (time - entered) / blend)
        targets = evaluate(self._pieces, np.clip(time / duration, 0.0, 1.0))
        return targets + fade[..., np.newaxis] * self._offset[(*ahead, slice(None))]


# A body that differs less than this from its first or last sample has not begun or has ended.
STILL_HEIGHT = 0.03  # share of the standing neck height
STILL_ANGLE = np.radians(5.0)
FLOOR_PERCENTILE = 5.0  # of the lowest foot's height over a clip: where the floor is


class ExtractionError(ValueError):
    """A record does not hold a rise; the message gives the reason."""


def compute_features(robot: Robot, neck: Array, orientation: Array, ground: Ground) -> Array:
    """Compute style features (T, 3) from neck positions [m], (T, 3), and orientations, (T, 4)."""
    size = robot.standing_neck_height
    height = (neck[:, 2] - mean_height(ground, neck[:, 0], neck[:, 1], AROUND * size)) / size
    angles = torso_angles(quaternion.gravity_in_body(orientation))
    return np.concatenate([height[:, None], angles], axis=-1)


def measure_features(
    robot: Robot, model: mujoco.MjModel, qpos: Array, ground: Ground = FLAT
) -> Array:
    """Measure style features (T, 3) of a robot at MuJoCo positions (T, nq)."""
    neck = site_positions(model, qpos, robot.neck_site)
    return compute_features(robot, neck, qpos[:, robot.layout(model).root_orientation], ground)


def measure_clip(clip: Clip) -> Array:
    """Measure style features (T, 3) of the body in a clip.

    The height is that of the neck's base over the floor, as a share of that in the rest pose.
    Front and side are those of [Frezzato22], figure 4, from hips and neck.
    """
    neck_name = clip.find("neck")
    left = clip.joints[clip.find("left hip")]
    right = clip.joints[clip.find("right hip")]
    neck, side = clip.joints[neck_name], right - left
    front = np.cross(neck - 0.5 * (left + right), side)
    standing = float(clip.rest[neck_name][2] - clip.lowest_foot(clip.rest)[2])
    feet = [path for name, path in clip.joints.items() if is_foot(name)]
    floor = np.percentile(np.min([path[:, 2] for path in feet], axis=0), FLOOR_PERCENTILE)
    features = np.empty((len(neck), COUNT))
    features[:, 0] = (neck[:, 2] - floor) / standing
    for column, vector in ((1, side), (2, front)):
        length = np.linalg.norm(vector, axis=1)
        if not length.all():
            raise ValueError(
                f"clip {clip.file}: hips and neck are in one line or one place in frame "
                f"{int(np.argmin(length)) + 1}, expected a torso"
            )
        features[:, column] = np.arccos(np.clip(vector[:, 2] / length, -1.0, 1.0))
    return features


def trim(features: Array) -> slice:
    """Find the samples of features (T, 3) from the first to the last movement."""
    moved = _differs(features, features[0])
    unfinished = _differs(features, features[-1])
    if not moved.any():
        raise ExtractionError("nothing moves in what is extracted, expected a rise")
    first = max(int(np.argmax(moved)) - 1, 0)
    last = len(features) - 1 - int(np.argmax(unfinished[::-1])) + 1
    return slice(first, min(last, len(features) - 1) + 1)


def extract_curves(time: Array, features: Array) -> StyleCurves:
    """Make curves through nine equally spaced samples of features (T, 3) at times (T,) [s]."""
    if features.shape != (len(time), COUNT):
        raise ExtractionError(f"features have shape {features.shape}, expected ({len(time)}, 3)")
    if features[-1, 0] < LEAST_END - ROUNDING:
        raise ExtractionError(
            f"the neck ends at {features[-1, 0]:.2f} of its standing height, expected "
            f"{LEAST_END:g} or more"
        )
    share = (time - time[0]) / (time[-1] - time[0])
    points = [np.interp(PLACES, share, column) for column in features.T]
    try:
        return StyleCurves.through(np.stack(points, axis=-1), float(time[-1] - time[0]))
    except ValueError as error:
        raise ExtractionError(str(error)) from error


def _differs(features: Array, still: Array) -> Array:
    is_higher = np.abs(features[:, 0] - still[0]) > STILL_HEIGHT
    return is_higher | (angle_distance(features, still) > STILL_ANGLE)
