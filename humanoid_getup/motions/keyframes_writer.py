"""Writes keyframes in compact form: symmetric angles as pairs, and changes only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tomlkit
from tomlkit.items import AoT, Table

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import TABLES, load_keyframes
from humanoid_getup.motions.motion import STANDING
from robots import Robot
from robots.body.sides import JointSides
from robots.quaternion import Array
from robots.storage.files import atomic_path, read_bounded
from robots.storage.toml_document import Value, one_a_line, plain, rounded, table_of, tables_of
from robots.storage.validation import MAX_TEXT

SYMMETRIC = math.radians(0.05)
"""Largest difference of left and right in a posture that is written as symmetric [rad]."""
DECIMALS = 2  # of an angle in degrees; a servo's tick is 0.09
TIME_DECIMALS = 3
DIGITS = 6  # of what the improvement looks for


def save_keyframes(path: Path, keyframes: Sequence[Keyframes], robot: Robot) -> None:
    """Write a file of keyframes, complete or not at all."""
    _write(path, format_keyframes(keyframes, robot), robot)


def append_keyframes(path: Path, keyframes: Sequence[Keyframes], robot: Robot) -> None:
    """Append motions to a file, or begin one; its text stays as it is."""
    if not path.exists():
        save_keyframes(path, keyframes, robot)
        return
    known = {each.name for each in load_keyframes(path, robot)}
    if twice := [f"'{each.name}'" for each in keyframes if each.name in known]:
        raise ValueError(
            f"{path}: motion {', '.join(twice)} is there already, expected another name"
        )
    _write(path, f"{_read(path).rstrip()}\n\n{format_keyframes(keyframes, robot)}", robot)


def replace_keyframes(path: Path, keyframes: Sequence[Keyframes], robot: Robot) -> None:
    """Replace the tables of motions in a file; all others and the comments between them stay."""
    names = [each.name for each in load_keyframes(path, robot)]
    document = tomlkit.parse(_read(path))
    tables = document["motions"]
    missing = [each.name for each in keyframes if each.name not in names]
    if missing or not isinstance(tables, AoT):
        raise ValueError(f"{path}: expected a table [[motions]] for {', '.join(missing or names)}")
    for each in keyframes:
        place = names.index(each.name)
        tables[place] = _replace(tables[place], table_of(_describe(each, robot)))
    _write(path, document.as_string(), robot)


def _replace(old: Table, new: Table) -> Table:
    """Replace a table, and keep the text after it: comments of the next one."""
    last = max(number for number, (key, _) in enumerate(old.value.body) if key is not None)
    for _, item in old.value.body[last + 1 :]:
        new.add(item)  # type: ignore[arg-type]
    new.trivia.indent = old.trivia.indent
    return new


def format_keyframes(keyframes: Sequence[Keyframes], robot: Robot) -> str:
    """Write motions as TOML tables."""
    document = tomlkit.document()
    document.add("motions", tables_of(_describe(each, robot) for each in keyframes))
    return document.as_string()


def _describe(keyframes: Keyframes, robot: Robot) -> dict[str, Value]:
    keys, rises = keyframes.keys, keyframes.end_class == STANDING
    if rises and np.abs(keys[-1] - robot.standing.joint_pos).max() > SYMMETRIC:
        raise ValueError(
            f"motion '{keyframes.name}' does not end in the standing posture, expected that as "
            "its last key"
        )
    after = [plain(duration, TIME_DECIMALS) for duration in keyframes.duration]
    row: dict[str, Value] = {"name": keyframes.name, "start": keyframes.start_class}
    row |= {} if rises else {"end": keyframes.end_class}
    row["strategy"] = keyframes.strategy
    row |= {"stand_after": after.pop()} if rises else {}
    row["torque_limit"] = rounded(keyframes.torque_limit, DIGITS)
    row["time"] = rounded(keyframes.time_cost, DIGITS)
    row["torque"] = rounded(keyframes.torque_cost, DIGITS)
    tables = _KeyWriter(keyframes, robot).describe_keys(len(after) + 1)
    timed = [{}, *({"after": time} for time in after)]
    row["keys"] = one_a_line(time | table for time, table in zip(timed, tables, strict=True))
    return row


class _KeyWriter:
    """Writes the keys of one motion as changes from each to the next."""

    def __init__(self, keyframes: Keyframes, robot: Robot) -> None:
        self._keyframes, self._robot, self._sides = keyframes, robot, JointSides(robot)
        self._is_symmetric = bool(keyframes.mirrored.any())
        starts_standing = keyframes.start_class == STANDING
        self._before = robot.standing.joint_pos if starts_standing else np.zeros(robot.n)

    def describe_keys(self, count: int) -> list[dict[str, Value]]:
        """Describe the first so many keys, each as its tables."""
        before, tables = self._before, []
        for number, key in enumerate(self._keyframes.keys[:count]):
            # A joint is free where a key names it, so the first one names all that are.
            wanted = set(self._keyframes.free.tolist()) if number == 0 else set()
            wanted |= set(np.flatnonzero(_round(key) != _round(before)).tolist())
            # What is to be optimized side by side is written so at least once.
            tables.append(self._describe(key, wanted, split=number == 0 and not self._is_symmetric))
            before = key
        return tables

    def _describe(self, key: Array, wanted: set[int], *, split: bool) -> dict[str, Value]:
        """Describe some joints of a posture, in up to four tables of degrees."""
        robot = self._robot
        found: dict[str, dict[str, Value]] = {name: {} for name in TABLES}
        for left in self._sides.left:
            right, name = int(robot.mirror_index[left]), self._sides.name(left)
            mirrored = robot.mirror_sign[left] * key[right]
            if not wanted & {left, right}:
                continue
            if abs(key[left] - mirrored) <= SYMMETRIC and not split:
                found["both"][name] = _degrees(0.5 * (key[left] + mirrored))
            else:
                found["left"][name], found["right"][name] = map(_degrees, (key[left], mirrored))
        for joint in sorted(wanted):
            if robot.mirror_index[joint] == joint:
                found["middle"][robot.joint_names[joint]] = _degrees(key[joint])
        return {table: angles for table, angles in found.items() if angles}


def _degrees(angle: float) -> int | float:
    return plain(math.degrees(angle), DECIMALS)


def _round(key: Array) -> Array:
    return np.asarray(np.round(np.degrees(key), DECIMALS), dtype=float)


def _read(path: Path) -> str:
    return read_bounded(path, MAX_TEXT).decode("utf-8")


def _write(path: Path, text: str, robot: Robot) -> None:
    """Write a file and read it again before it replaces the old one."""
    with atomic_path(path) as partial:
        partial.write_text(text, "utf-8")
        try:
            load_keyframes(partial, robot)
        except ValueError as error:
            raise ValueError(str(error).replace(str(partial), str(path))) from error
