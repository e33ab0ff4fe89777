"""Files of keyframes: hand-written key postures, in degrees by joint."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import NAME, STANDING, EndClass, StartClass
from robots import Robot
from robots.body.sides import JointSides
from robots.quaternion import Array
from robots.storage.validation import (
    name_unknown_joints,
    outside,
    positive,
    read_toml,
    reading,
    shown,
)

KEYFRAMES = "keyframes.toml"
"""The file of a robot's folder."""
ROUNDING = 0.01  # deg; a file's angle may be this far out of a joint's range, as it is rounded
NAMED = "expected 1 to 100 letters, digits, '_', '-' or '.', not '.' first"


Degrees = dict[str, Annotated[float, Meta(description="a finite angle in degrees")]]
PAIRED = ("both", "left", "right")
"""Tables of a key whose names are those of pairs; ``middle`` has full names."""
TABLES = (*PAIRED, "middle")


@dataclass(frozen=True, kw_only=True)
class _Key:
    """One key posture of a file."""

    after: Annotated[float, Meta(ge=0.0, description="0 s or more")] = 0.0
    both: Degrees = field(default_factory=dict)
    left: Degrees = field(default_factory=dict)
    right: Degrees = field(default_factory=dict)
    middle: Degrees = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Row:
    """One table [[motions]] of a file."""

    name: str
    start: StartClass
    strategy: str
    torque_limit: Annotated[float, positive(1000.0, "N·m")]
    keys: tuple[_Key, ...]
    end: EndClass = STANDING
    stand_after: Annotated[float, positive(60.0, "s")] | None = None
    time: Annotated[float, Meta(ge=0.0, description="0 or more")] = 0.5
    torque: Annotated[float, Meta(ge=0.0, description="0 or more")] = 1.0


@dataclass(frozen=True, kw_only=True)
class _File:
    motions: tuple[_Row, ...]


def load_keyframes(path: Path, robot: Robot) -> list[Keyframes]:
    """Load key postures from a TOML file.

    Each motion has ``keys``: a list of tables with ``after`` (seconds since the key
    before) and the angles [deg] that change there: under ``both`` (left joints, mirrored to the
    right), ``left`` or ``right`` (in the left joint's sense) by the name of the pair, which is
    that of its left joint with or without the side; or under ``middle`` by full name. The standing
    posture follows as last key, ``stand_after`` seconds later, unless the motion's ``end`` is a
    side to lie on.
    """
    with reading(str(path)) as problems:
        file = read_toml(_File, path, problems)
        names = Counter(row.name for row in file.motions)
        problems += [f"motion {shown(name)} is there twice" for name in names if names[name] > 1]
        reader = _Reader(robot)
        keyframes = [reader.read(row) for row in file.motions]
        problems += reader.problems
    return [each for each in keyframes if each is not None]


class _Reader:
    """Reads the rows of a file for a robot, and collects their problems."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._sides = robot, JointSides(robot)
        self.problems: list[str] = []

    def read(self, row: _Row) -> Keyframes | None:
        """Read a row; return ``None`` if it has a problem."""
        before = len(self.problems)
        self.problems += _find_problems(row)
        changes = [self._resolve(row, number) for number in range(1, len(row.keys) + 1)]
        if len(self.problems) > before:
            return None
        keyframes = _build_keyframes(row, changes, self._robot)
        beyond = find_out_of_range(keyframes.keys, self._robot)
        self.problems += [f"motion {shown(row.name)}: {text}" for text in beyond]
        return keyframes

    def _resolve(self, row: _Row, number: int) -> list[_Change]:
        """Find the joints named by a key, which is counted from 1."""
        key, place = row.keys[number - 1], f"motion {shown(row.name)}: key number {number}: "
        changes: list[_Change] = []
        names = self._robot.joint_names
        for table in TABLES:
            known = {joint_name: joint for joint, joint_name in enumerate(names)}
            expected: Sequence[str] = names
            if table in PAIRED:
                known = self._sides.by_name
                expected = [self._sides.name(joint) for joint in self._sides.left]
            given: dict[str, float] = getattr(key, table)
            unknown = [name for name in given if name not in known]
            wrong = name_unknown_joints(unknown, expected)
            self.problems += [f"{place}{table}: {text}" for text in wrong]
            found = [_Change(table, known[name], given[name]) for name in given if name in known]
            twice = [joint for joint, n in Counter(c.joint for c in found).items() if n > 1]
            self.problems += [
                f"{place}{table}: joint '{names[joint]}' is there twice" for joint in twice
            ]
            changes += found
        return changes


@dataclass(frozen=True)
class _Change:
    """An angle given by a key."""

    table: str
    joint: int
    """The left one of a pair."""
    degrees: float


def find_out_of_range(
    keys: Array, robot: Robot, tolerance: float = math.radians(ROUNDING)
) -> list[str]:
    """Report joints whose angles in keys (K, n) [rad] leave their range, each at its farthest."""
    excess = np.maximum(keys - robot.upper, robot.lower - keys)
    problems = []
    for joint in np.flatnonzero(excess.max(axis=0) > tolerance):
        key, limits = int(np.argmax(excess[:, joint])), (robot.lower[joint], robot.upper[joint])
        angle, lower, upper = np.degrees([keys[key, joint], *limits]).tolist()
        found = outside(angle, lower, upper, "deg")
        problems.append(f"joint '{robot.joint_names[joint]}' of key number {key + 1} is {found}")
    return problems


def _find_problems(row: _Row) -> list[str]:
    problems = []
    if row.end == STANDING and row.stand_after is None:
        problems.append("stand_after is missing, expected the time to the stand [s]")
    if row.end != STANDING and row.stand_after is not None:
        problems.append(f"stand_after is given, expected none: it ends {row.end}")
    if row.name and not NAME.fullmatch(row.name):
        problems.append(f"its name: {NAMED}")
    if row.end != STANDING and len(row.keys) == 1:
        problems.append("it has 1 key, expected 2 or more")
    problems += [
        f"key number {number}: after is 0 s, expected above 0 s"
        for number, key in enumerate(row.keys[1:], start=2)
        if key.after == 0.0
    ]
    return [f"motion {shown(row.name)}: {text}" for text in problems]


def _build_keyframes(row: _Row, changes: list[list[_Change]], robot: Robot) -> Keyframes:
    standing = robot.standing.joint_pos
    posture, keys = standing if row.start == STANDING else np.zeros(robot.n), []
    for some in changes:
        posture = posture.copy()
        for change in some:
            _set(posture, change, robot)
        keys.append(posture)
    duration = [key.after for key in row.keys[1:]]
    if row.stand_after is not None:
        keys.append(standing)
        duration.append(row.stand_after)
    named = [change for some in changes for change in some]
    free, mirrored = _choose_free(named, robot)
    return Keyframes(
        name=row.name,
        start_class=row.start,
        end_class=row.end,
        strategy=row.strategy,
        duration=np.array(duration),
        keys=np.array(keys),
        free=free,
        mirrored=mirrored,
        torque_limit=row.torque_limit,
        time_cost=row.time,
        torque_cost=row.torque,
    )


def _set(posture: Array, change: _Change, robot: Robot) -> None:
    """Set the joint, or joints, that a key names, in place."""
    angle, partner = math.radians(change.degrees), int(robot.mirror_index[change.joint])
    mirrored = robot.mirror_sign[change.joint] * angle
    if change.table != "right":
        posture[change.joint] = angle
    if change.table in ("both", "right"):
        posture[partner] = mirrored


def _choose_free(named: list[_Change], robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Choose the joints to optimize, and whether their partners mirror them."""
    partner = robot.mirror_index
    used = {change.joint for change in named}
    one_sided = (c.joint for c in named if c.table != "both")
    is_symmetric = all(partner[joint] == joint for joint in one_sided)
    free = sorted(used if is_symmetric else used | {int(partner[joint]) for joint in used})
    paired = [is_symmetric and int(partner[joint]) != joint for joint in free]
    return np.array(free, dtype=int), np.array(paired, dtype=bool)
