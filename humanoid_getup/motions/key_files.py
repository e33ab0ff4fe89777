"""Key sequences: postures and the times between them, from files of other programs.

They are tables (CSV) and animations of the Bit-Bots' soccer robots (JSON).
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from humanoid_getup.motions.motion import MAX_DURATION
from robots import Robot
from robots.quaternion import Array
from robots.storage.validation import (
    name_unknown_joints,
    parse_file,
    read_table,
    reading,
    shown,
)

MOST_KEYS = 120
"""Keys of a sequence; one with more is a recording, not keys."""


@dataclass(frozen=True, kw_only=True)
class KeySequence:
    """Key postures of one motion and the times between them."""

    name: str
    source: str
    """Its source, for messages."""
    keys: Array
    """Joint angles [rad], shape (K, n), in the robot's joint order."""
    after: Array
    """Time from each key to the next [s], shape (K-1,), above 0."""
    notes: tuple[str, ...] = ()
    """Messages about content that keys cannot express."""


@dataclass(kw_only=True)
class KeyCollector:
    """Collects keys in order; joints that a key omits keep their last angles.

    Joints that are not in the first key stand as in the robot's stance.
    """

    robot: Robot
    keys: list[Array] = field(default_factory=list)
    after: list[float] = field(default_factory=list)

    def add(self, move: float, angles: Mapping[int, float], pause: float = 0.0) -> None:
        """Add a key that is reached in ``move`` and held for ``pause`` [s].

        A move of no time is given one control period.
        """
        posture = (self.keys[-1] if self.keys else self.robot.standing.joint_pos).copy()
        for joint, angle in angles.items():
            posture[joint] = angle
        if self.keys:
            self.after.append(max(move, self.robot.control_period))
        self.keys.append(posture)
        if pause > 0.0:
            self.keys.append(posture)
            self.after.append(pause)

    def finish(self, name: str, source: str, notes: tuple[str, ...] = ()) -> KeySequence:
        """Return the sequence."""
        duration = sum(self.after)
        if not self.keys:
            raise ValueError(f"{source} has no keys, expected one or more")
        if len(self.keys) > MOST_KEYS:
            raise ValueError(f"{source} has {len(self.keys)} keys, expected at most {MOST_KEYS}")
        if duration > MAX_DURATION:
            raise ValueError(
                f"{source} lasts {duration:.4g} s, expected at most {MAX_DURATION:g} s"
            )
        return KeySequence(
            name=name,
            source=source,
            keys=np.array(self.keys),
            after=np.array(self.after),
            notes=notes,
        )


Seconds = Annotated[float, Meta(ge=0.0, description="0 s or more")]
Goals = dict[str, Annotated[float, Meta(description="a finite angle in degrees")]]


@dataclass(frozen=True, kw_only=True)
class _Keyframe:
    goals: Goals
    duration: Seconds = 1.0
    pause: Seconds = 0.0
    torque: dict[str, Any] = field(default_factory=dict)
    stabilization_functions: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Animation:
    keyframes: tuple[_Keyframe, ...]
    name: str = ""


def load_animation(path: Path, robot: Robot) -> KeySequence:
    """Read an animation in JSON, in the format of the Bit-Bots' soccer robots.

    An object with a name and ``keyframes``: each has ``goals`` (degrees by joint name), the time in
    which they are reached and that for which they are held, ``duration`` (1 if left out) and
    ``pause`` (0) [s], and may switch joints off in ``torque`` or correct them in
    ``stabilization_functions``.
    """
    with reading(str(path)) as problems:
        content = parse_file(path, "JSON", json.loads)
        if not isinstance(content, dict):
            raise ValueError("expected an object with keyframes")
        animation = read_table(_Animation, content, "", problems)
        given = [name for keyframe in animation.keyframes for name in keyframe.goals]
        unknown = [name for name in dict.fromkeys(given) if name not in robot.joint_names]
        problems += name_unknown_joints(unknown, robot.joint_names)
    collector, names = KeyCollector(robot=robot), robot.joint_names
    for keyframe in animation.keyframes:
        angles = {names.index(name): math.radians(a) for name, a in keyframe.goals.items()}
        collector.add(keyframe.duration, angles, keyframe.pause)
    notes = _find_notes(animation)
    return collector.finish(animation.name or path.stem, path.name, notes)


def _find_notes(animation: _Animation) -> tuple[str, ...]:
    notes = []
    if released := {n for k in animation.keyframes for n, on in k.torque.items() if not on}:
        listed = ", ".join(f"'{name}'" for name in sorted(released))
        notes.append(f"joints {listed} are released on the way: here they keep their targets")
    if any(keyframe.stabilization_functions for keyframe in animation.keyframes):
        notes.append("its stabilization functions are left out")
    return tuple(notes)


TIME = "time"
DEGREES = "_deg"


def load_key_table(path: Path, robot: Robot) -> KeySequence:
    """Read a CSV table as keys: a column ``time`` [s], and one a joint in rad, or ``JOINT_deg``."""
    with reading(str(path)):
        header, *rows = parse_file(path, "CSV", _read_rows) or [[]]
        if not rows:
            raise ValueError("no keys, expected a header and one row or more")
        joints = _find_joints(header, robot)
        table = _read_numbers(header, rows)
    time = table[:, header.index(TIME)]
    collector = KeyCollector(robot=robot)
    for row, move in zip(table, np.diff(time, prepend=time[0]), strict=True):
        angles = {joint: scale * row[c] for c, (joint, scale) in joints.items()}
        collector.add(float(move), angles)
    return collector.finish(path.stem, path.name)


def _read_rows(text: str) -> list[list[str]]:
    """Read the rows that are not blank; the first has the names of the columns."""
    try:
        rows = csv.reader(io.StringIO(text), strict=True)
        return [[cell.strip() for cell in row] for row in rows if any(row)]
    except csv.Error as error:
        raise ValueError(str(error)) from error


def _find_joints(header: list[str], robot: Robot) -> dict[int, tuple[int, float]]:
    """Find the joint of each column, and the factor that converts it to radians."""
    names, joints, unknown = robot.joint_names, {}, []
    for column, name in enumerate(header):
        bare = name.removesuffix(DEGREES)
        if name in names:
            joints[column] = names.index(name), 1.0
        elif name != bare and bare in names:
            joints[column] = names.index(bare), math.pi / 180.0
        elif name != TIME:
            unknown.append(name)
    if header.count(TIME) != 1:
        raise ValueError(f"the header has {header.count(TIME)} columns '{TIME}', expected one")
    if problems := name_unknown_joints(unknown, names):
        raise ValueError(f"{problems[0]}, each also with {DEGREES}")
    if not joints or len({joint for joint, _ in joints.values()}) < len(joints):
        raise ValueError("a joint has two columns or none has one, expected one for each joint")
    return joints


def _read_numbers(header: list[str], rows: list[list[str]]) -> Array:
    """Read the rows, (K, columns); times must rise."""
    if len(rows) > MOST_KEYS:
        raise ValueError(f"has {len(rows)} rows, expected at most {MOST_KEYS}: leave some out")
    table = np.zeros((len(rows), len(header)))
    for k, row in enumerate(rows):
        if len(row) != len(header):
            raise ValueError(f"row {k + 1} has {len(row)} values, expected {len(header)}")
        for c, text in enumerate(row):
            table[k, c] = _read_number(text, f"row {k + 1}: {header[c]}")
    time = table[:, header.index(TIME)]
    if np.any(np.diff(time) <= 0.0):
        k = int(np.argmax(np.diff(time) <= 0.0)) + 1
        raise ValueError(
            f"row {k + 1}: time is {time[k]:g} s, expected after {time[k - 1]:g} s of row {k}"
        )
    return table


def _read_number(text: str, place: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{place} is {shown(text)}, expected a finite number")
    return value
