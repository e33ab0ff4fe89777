"""A clip of motion capture: positions of a body's joints over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
