"""A clip of motion capture: positions of a body's joints over time, and the axes of its parts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robots.body.limbs import LIMB_NAMES, LimbName, LimbPose
from robots.quaternion import Array
from robots.storage.files import describe, read_bounded

# What capture systems and editors call the joints that the features need.
LEFT_HIPS = ("lfemur", "LeftUpLeg", "LeftHip", "LeftThigh", "lThigh", "LHipJoint", "L_Hip")
RIGHT_HIPS = ("rfemur", "RightUpLeg", "RightHip", "RightThigh", "rThigh", "RHipJoint", "R_Hip")
NECKS = ("lowerneck", "Neck", "neck", "Neck1", "NeckBase")
FEET = ("foot", "toe", "ankle")
UP = {"y": 1, "z": 2}
LONGEST_FRAME = 1.0  # s
MOST_BYTES = 64 * 2**20  # of a file: ten minutes of a body of 70 joints at 120 Hz
MOST_OF_SKELETON = 4 * 2**20  # bytes
MOST_POSITIONS = 6_000_000  # of all joints in all frames
READ_ERRORS = (ValueError, IndexError, KeyError, ZeroDivisionError)
"""Errors that the content of a file that is not a clip may raise."""


def read_lines(file: Path, most: int = MOST_BYTES) -> list[str]:
    """Read the lines of a text file that are not empty."""
    text = read_bounded(file, most).decode("utf-8-sig")
    return [line for line in text.splitlines() if line.strip()]


def read_numbers(lines: Sequence[str], columns: int) -> Array:
    """Read lines of finite numbers, (T, columns), with little more memory than they take."""
    if columns == 0 or not lines:
        raise ValueError(f"{len(lines)} frames of {columns} numbers, expected one or more of each")
    rows = np.loadtxt(lines, comments=None, ndmin=2)
    if rows.shape != (len(lines), columns):
        raise ValueError(f"{rows.shape[1]} numbers a frame, expected {columns}")
    if not np.isfinite(rows).all():
        frame, number = np.argwhere(~np.isfinite(rows))[0] + 1
        raise ValueError(f"number {number} of frame {frame} is not finite")
    return rows


def check_size(frames: int, joints: int) -> None:
    """Raise ValueError if a clip has more positions than a recording of a body."""
    if frames * joints > MOST_POSITIONS:
        raise ValueError(
            f"{frames} frames of {joints} joints, expected at most {MOST_POSITIONS} positions"
        )


def explain(error: Exception) -> str:
    """Describe the problem of a file's content from one of `READ_ERRORS`."""
    if isinstance(error, KeyError):
        return f"{error} is missing"
    return "a word or number is missing" if isinstance(error, IndexError) else describe(error)


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """Joint positions over time, and in the rest pose, in which the body stands."""

    file: Path
    period: float
    """Time between two frames [s]."""
    joints: Mapping[str, Array]
    """Positions of each joint by name, (T, 3), in any unit of length."""
    rest: Mapping[str, Array]
    """Positions in the rest pose, (3,), in the same unit."""
    unit: float = 1.0
    """One unit of length [m]."""
    up: str = "y"
    """Axis that points up."""

    def __post_init__(self) -> None:
        if not 0.0 < self.period <= LONGEST_FRAME:
            raise ValueError(
                f"clip {self.file}: a frame lasts {self.period:g} s, expected above 0 s, at most "
                f"{LONGEST_FRAME:g} s"
            )
        for name in self.joints:
            if not (np.isfinite(self.joints[name]).all() and np.isfinite(self.rest[name]).all()):
                raise ValueError(
                    f"clip {self.file}: joint '{name}' has no finite position in every frame"
                )

    @property
    def time(self) -> Array:
        """Return the time of each frame [s], (T,)."""
        frames = len(next(iter(self.joints.values())))
        return np.arange(frames, dtype=float) * self.period

    @property
    def leg_length(self) -> float:
        """Return the distance from the hips to the lowest foot in the rest pose [m]."""
        left, right = self.find(LEFT_HIPS, "left hip"), self.find(RIGHT_HIPS, "right hip")
        hips = 0.5 * (self.rest[left] + self.rest[right])
        length = self.unit * float((hips - self.lowest_foot(self.rest))[UP[self.up]])
        return self.check_height("the middle of the hips", length)

    def check_height(self, what: str, height: float) -> float:
        """Check the height of a point over the feet in the rest pose [m], which must be a stand."""
        if height <= 0.0:
            other = next(axis for axis in UP if axis != self.up)
            raise ValueError(
                f"clip {self.file}: in the rest pose {what} is {height:.3g} m over the feet "
                f"along {self.up}, expected a stand; does {other} point up (--up {other})?"
            )
        return height

    def find(self, names: tuple[str, ...], what: str) -> str:
        """Find the joint that has one of some names."""
        found = [name for name in names if name in self.joints]
        if not found:
            raise ValueError(
                f"clip {self.file}: it has no {what}, expected a joint {', '.join(names)}"
            )
        return found[0]

    def lowest_foot(self, pose: Mapping[str, Array]) -> Array:
        """Return the position of the lowest foot joint in a pose, (3,)."""
        feet = [pose[name] for name in pose if is_foot(name)]
        if not feet:
            raise ValueError(f"clip {self.file}: it has no joint of a foot")
        return min(feet, key=lambda point: point[UP[self.up]])


def is_foot(name: str) -> bool:
    """Tell whether a joint is one of a foot, by its name."""
    return any(part in name.lower() for part in FEET)


# What capture systems and editors call the joints of a left limb; the right one's follow.
SHOULDERS = ("lhumerus", "LeftArm", "LeftUpArm", "LeftShoulder", "lShldr", "L_Shoulder")
ELBOWS = ("lradius", "LeftForeArm", "LeftLowArm", "LeftElbow", "lForeArm", "L_Elbow")
WRISTS = ("lwrist", "LeftHand", "LeftWrist", "lHand", "L_Wrist")
KNEES = ("ltibia", "LeftLeg", "LeftKnee", "LeftShin", "LeftLowLeg", "lShin", "L_Knee")
ANKLES = ("lfoot", "LeftFoot", "LeftAnkle", "lFoot", "L_Ankle")
TOES = ("ltoes", "LeftToeBase", "LeftToe", "lToe", "L_Toe", "L_Foot")
SPINES = ("upperback", "Spine1", "Spine", "Chest", "spine", "abdomen", "Spine_1")
"""A joint above the pelvis, below the chest."""
SMALL = 1e-9


@dataclass(frozen=True, eq=False)
class LimbTrack:
    """Directions of a limb in the world over time."""

    upper: Array
    """Unit vectors along upper arm or thigh, (T, 3)."""
    lower: Array
    """Unit vectors along forearm or shank, (T, 3)."""
    foot: Array | None
    """Forward, left and up of the foot, in columns, (T, 3, 3); None for an arm, or without toes."""

    def pose(self, frame: int, torso: Array) -> LimbPose:
        """Return the pose at a frame relative to the axes of a torso (3, 3)."""
        foot = None if self.foot is None else torso.T @ self.foot[frame]
        return LimbPose(torso.T @ self.upper[frame], torso.T @ self.lower[frame], foot)


@dataclass(frozen=True, eq=False, kw_only=True)
class ClipBody:
    """Axes and limbs of a clip's body in a world whose z axis points up."""

    hips: Array
    """Middle of the hips [m], (T, 3)."""
    pelvis: Array
    """Forward, left and up of the pelvis, in columns, (T, 3, 3)."""
    torso: Array
    """The same of the whole trunk, from the hips to the neck, (T, 3, 3)."""
    chest: Array
    """The same of the chest, from the middle of the spine to neck and shoulders, (T, 3, 3)."""
    limbs: dict[LimbName, LimbTrack]


def read_body(clip: Clip) -> ClipBody:
    """Find the body in a clip.

    The axes of pelvis, trunk and chest are those of the world where the body stands in the clip's
    rest pose.
    """
    places, rest = _Places(clip, is_rest=False), _Places(clip, is_rest=True)
    return ClipBody(
        hips=places.hips() * clip.unit,
        pelvis=_from_rest(places.pelvis(), rest.pelvis()),
        torso=_from_rest(places.torso(), rest.torso()),
        chest=_from_rest(places.chest(), rest.chest()),
        limbs={
            name: places.limb(name, rest)
            for name in LIMB_NAMES
            if "leg" in name or places.has(name)
        },
    )


class _Places:
    """Positions of a clip's joints, or of its rest pose as a single frame."""

    def __init__(self, clip: Clip, *, is_rest: bool) -> None:
        self._clip, self._is_rest = clip, is_rest

    def of(self, names: tuple[str, ...], what: str) -> Array:
        """Return the positions of the joint with one of some names, z up, (T, 3)."""
        name = self._clip.find(names, what)
        rows = self._clip.rest[name][None] if self._is_rest else self._clip.joints[name]
        # A y axis that points up becomes z: x stays, and z becomes -y.
        return rows[:, [0, 2, 1]] * [1.0, -1.0, 1.0] if UP[self._clip.up] == 1 else rows

    def has(self, limb: LimbName) -> bool:
        """Tell whether the clip has an arm's elbow and wrist."""
        side = limb.split("_")[0]
        return all(set(_on_side(n, side)) & self._clip.joints.keys() for n in (ELBOWS, WRISTS))

    def hips(self) -> Array:
        """Return the middle of the hips, (T, 3)."""
        left, right = self._hip_ends()
        return 0.5 * (left + right)

    def pelvis(self) -> Array:
        """Return the axes of the hips and the spine above them, (T, 3, 3)."""
        left, right = self._hip_ends()
        return self._axes(left - right, self._spine() - self.hips(), "hips and spine")

    def torso(self) -> Array:
        """Return the axes of hips and neck, (T, 3, 3)."""
        left, right = self._hip_ends()
        return self._axes(left - right, self._neck() - self.hips(), "hips and neck")

    def chest(self) -> Array:
        """Return the axes of shoulders and neck, (T, 3, 3)."""
        across = self._joint(SHOULDERS, "left", "shoulder")
        across = across - self._joint(SHOULDERS, "right", "shoulder")
        return self._axes(across, self._neck() - self._spine(), "shoulders and neck")

    def limb(self, name: LimbName, rest: _Places) -> LimbTrack:
        """Return the directions of a limb."""
        side, kind = name.split("_")
        if kind == "arm":
            parts = ((SHOULDERS, "shoulder"), (ELBOWS, "elbow"), (WRISTS, "wrist"))
            first, middle, end = (self._joint(names, side, what) for names, what in parts)
        else:
            first = self._hip_ends()[0 if side == "left" else 1]
            middle, end = (
                self._joint(names, side, what)
                for names, what in ((KNEES, "knee"), (ANKLES, "ankle"))
            )
        upper = self._unit(middle - first, f"upper {name}")
        lower = self._unit(end - middle, f"lower {name}")
        return LimbTrack(upper, lower, self._foot(side, lower, rest) if kind == "leg" else None)

    def _foot(self, side: str, lower: Array, rest: _Places) -> Array | None:
        """Return the axes of a foot, level where it is in the rest pose, (T, 3, 3)."""
        if not set(_on_side(TOES, side)) & self._clip.joints.keys():
            return None
        forward, still = self._forward(side), rest._forward(side)[0]
        left = self._unit(np.cross(-lower, forward), f"{side} foot")
        up = np.cross(forward, left)
        slope = math.asin(float(np.clip(still[2], -1.0, 1.0)))  # of the way to the toes, at rest
        level = math.cos(slope) * forward - math.sin(slope) * up
        return np.stack([level, left, np.cross(level, left)], axis=-1)

    def _forward(self, side: str) -> Array:
        toes, ankle = self._joint(TOES, side, "toes"), self._joint(ANKLES, side, "ankle")
        return self._unit(toes - ankle, f"{side} foot")

    def _hip_ends(self) -> tuple[Array, Array]:
        return self.of(LEFT_HIPS, "left hip"), self.of(RIGHT_HIPS, "right hip")

    def _neck(self) -> Array:
        return self.of(NECKS, "neck")

    def _spine(self) -> Array:
        """Return a joint of the spine; without one, a place between hips and neck."""
        if set(SPINES) & self._clip.joints.keys():
            return self.of(SPINES, "spine")
        return 0.5 * (self.hips() + self._neck())

    def _joint(self, names: tuple[str, ...], side: str, what: str) -> Array:
        return self.of(_on_side(names, side), f"{side} {what}")

    def _axes(self, left: Array, up: Array, what: str) -> Array:
        """Return axes with their left along one vector and their up near another, (T, 3, 3)."""
        left = self._unit(left, what)
        forward = self._unit(np.cross(left, up), what)
        return np.stack([forward, left, np.cross(forward, left)], axis=-1)

    def _unit(self, rows: Array, what: str) -> Array:
        length = np.linalg.norm(rows, axis=-1)
        if length.min() <= SMALL:
            raise ValueError(
                f"clip {self._clip.file}: {what} are in one place or line in frame "
                f"{int(np.argmin(length)) + 1}, expected a body"
            )
        return rows / length[:, None]


def _from_rest(axes: Array, rest: Array) -> Array:
    """Turn axes (T, 3, 3) so that in the rest pose (1, 3, 3) they stand upright."""
    left = rest[0, :, 1] * [1.0, 1.0, 0.0]
    left = left / max(float(np.linalg.norm(left)), SMALL)
    up = np.array([0.0, 0.0, 1.0])
    upright = np.stack([np.cross(left, up), left, up], axis=-1)
    return axes @ rest[0].T @ upright


def _on_side(names: tuple[str, ...], side: str) -> tuple[str, ...]:
    if side == "left":
        return names
    return tuple(
        name.replace("Left", "Right")
        if "Left" in name
        else {"l": "r", "L": "R"}[name[0]] + name[1:]
        for name in names
    )
