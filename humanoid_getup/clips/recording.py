"""A recording: positions of joints as a file has them, in any unit, with any axis up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.joint_names import list_names, name_joint
from robots.quaternion import Array
from robots.storage.files import describe, read_bounded

LONGEST_FRAME = 1.0  # s
MOST_BYTES = 64 * 2**20  # of a file: ten minutes of a body of 70 joints at 120 Hz
MOST_OF_SKELETON = 4 * 2**20  # bytes
MOST_POSITIONS = 6_000_000  # of all joints in all frames
READ_ERRORS = (ValueError, IndexError, KeyError, ZeroDivisionError)
"""Errors that the content of a file that is not a clip may raise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Joint positions over time, and with all angles zero."""

    file: Path
    period: float
    """Time between two frames [s]."""
    joints: Mapping[str, Array]
    """Positions of each joint by name, (T, 3)."""
    rest: Mapping[str, Array]
    """Positions with all angles zero, (3,)."""
    unit: float | None = None
    """One unit of length [m], where the file says it."""

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

    def has(self, what: str) -> bool:
        """Tell whether it has a joint, such as the "left hip"."""
        return not self.joints.keys().isdisjoint(name_joint(what))

    def find(self, what: str) -> str:
        """Find the name of a joint, such as the "left hip"."""
        names = name_joint(what)
        if not self.has(what):
            raise ValueError(
                f"clip {self.file}: it has no {what}, expected a joint {', '.join(names)}; it has "
                f"{list_names(self.joints)} (--rename NAME={names[0]} renames one)"
            )
        return next(name for name in names if name in self.joints)


def place_joints(
    names: Sequence[str],
    parents: Sequence[int],
    offsets: Sequence[Array],
    turns: Sequence[Rotation],
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Compute the position of each joint in all frames, (T, 3), and with all angles zero, (3,).

    Offsets (T, 3) and turns are in the frame of the joint's parent, which comes before it; the row
    of that of a root is -1.
    """
    places, world = [*offsets], [*turns]
    rest = [np.zeros(3) for _ in offsets]
    for k, parent in enumerate(parents):
        if parent >= 0:
            places[k] = places[parent] + world[parent].apply(offsets[k])
            world[k] = world[parent] * turns[k]
            rest[k] = rest[parent] + np.median(offsets[k], axis=0)
    return dict(zip(names, places, strict=True)), dict(zip(names, rest, strict=True))


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
