"""Writes keyframes as people do: by pairs where left and right are alike, changes only."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KeyframesError, load_keyframes
from humanoid_getup.motions.motion import STANDING
from robots import Robot
from robots.files import atomic_path, read_bounded
from robots.quaternion import Array
from robots.sides import JointSides
from robots.validation import MAX_TEXT

SYMMETRIC = math.radians(0.05)
"""How far left and right may differ in a posture that is written as symmetric [rad]."""
DECIMALS = 2  # of an angle in degrees; a servo's tick is 0.09
TIME_DECIMALS = 3
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
TABLE = re.compile(r"^[ \t]*\[\[[ \t]*motions[ \t]*\]\]", re.MULTILINE)
BETWEEN = re.compile(r"(\n\s*(#[^\n]*)?)*\Z")
"""Blank lines and comments after a table: they belong to the next one."""


def save_keyframes(path: Path, keyframes: Sequence[Keyframes], robot: Robot) -> None:
    """Write a file of keyframes, complete or not at all.

    Raises:
        KeyframesError: if a file cannot hold them.
        OSError: if it cannot be written.
    """
    _write(path, _format_all(keyframes, robot), robot)


def append_keyframes(path: Path, keyframes: Sequence[Keyframes], robot: Robot) -> None:
    """Add motions to the end of a file, or begin one; its text stays as it is.

    Raises:
        KeyframesError: if the file is damaged, or has a motion of that name.
        OSError: if it cannot be written.
    """
    if not path.exists():
        save_keyframes(path, keyframes, robot)
        return
    known = {each.name for each in load_keyframes(path, robot)}
    if twice := [f"'{each.name}'" for each in keyframes if each.name in known]:
        raise KeyframesError(
            f"{path}: motion {', '.join(twice)} is there already, expected another name"
        )
    _write(path, f"{_read(path).rstrip()}\n\n{_format_all(keyframes, robot)}", robot)


def replace_keyframes(path: Path, keyframes: Sequence[Keyframes], robot: Robot) -> None:
    """Replace the tables of motions in a file; all others and the comments between them stay.

    Raises:
        KeyframesError: if the file is damaged, or lacks one of them as a table [[motions]].
        OSError: if it cannot be written.
    """
    names, text = [each.name for each in load_keyframes(path, robot)], _read(path)
    starts = [match.start() for match in TABLE.finditer(text)]
    missing = [each.name for each in keyframes if each.name not in names]
    if missing or len(starts) != len(names):
        raise KeyframesError(
            f"{path}: expected a table [[motions]] for {', '.join(missing or names)}"
        )
    blocks = [text[a:b] for a, b in zip(starts, [*starts[1:], len(text)], strict=True)]
    for each in keyframes:
        place = names.index(each.name)
        between = BETWEEN.search(blocks[place])
        tail = between.group() if between else "\n"
        blocks[place] = format_keyframes(each, robot).rstrip() + tail
    _write(path, text[: starts[0]] + "".join(blocks), robot)


def format_keyframes(keyframes: Keyframes, robot: Robot) -> str:
    """Write one motion as a TOML table.

    Raises:
        KeyframesError: if it should end standing, but its last key is another posture.
    """
    keys, rises = keyframes.keys, keyframes.end_class == STANDING
    if rises and np.abs(keys[-1] - robot.standing.joint_pos).max() > SYMMETRIC:
        raise KeyframesError(
            f"motion '{keyframes.name}' does not end in the standing posture, expected that as "
            "its last key"
        )
    after = [_number(duration, TIME_DECIMALS) for duration in keyframes.duration]
    lines = [
        "[[motions]]",
        f"name = {_text(keyframes.name)}",
        f"start = {_text(keyframes.start_class)}",
        *([] if rises else [f"end = {_text(keyframes.end_class)}"]),
        f"strategy = {_text(keyframes.strategy)}",
        *([f"stand_after = {after.pop()}"] if rises else []),
        f"torque_limit = {keyframes.torque_limit:.6g}",
        f"time = {keyframes.time_cost:.6g}",
        f"torque = {keyframes.torque_cost:.6g}",
        "keys = [",
    ]
    tables = _KeyWriter(keyframes, robot).format_keys(len(after) + 1)
    for key, table in enumerate(tables):
        timed = [f"after = {after[key - 1]}"] if key else []
        lines.append(f"  {{ {', '.join(timed + table)} }},".replace("{  }", "{ }"))
    return "\n".join([*lines, "]", ""])


class _KeyWriter:
    """Writes the keys of one motion: what changes from each to the next."""

    def __init__(self, keyframes: Keyframes, robot: Robot) -> None:
        self._keyframes, self._robot, self._sides = keyframes, robot, JointSides(robot)
        self._is_symmetric = bool(keyframes.mirrored.any())
        starts_standing = keyframes.start_class == STANDING
        self._before = robot.standing.joint_pos if starts_standing else np.zeros(robot.n)

    def format_keys(self, count: int) -> list[list[str]]:
        """Write the first so many keys, each as its tables."""
        before, tables = self._before, []
        for number, key in enumerate(self._keyframes.keys[:count]):
            # A joint is free where a key names it, so the first one names all that are.
            wanted = set(self._keyframes.free.tolist()) if number == 0 else set()
            wanted |= set(np.flatnonzero(_round(key) != _round(before)).tolist())
            # What is to be optimized side by side is written so at least once.
            tables.append(self._format(key, wanted, split=number == 0 and not self._is_symmetric))
            before = key
        return tables

    def _format(self, key: Array, wanted: set[int], *, split: bool) -> list[str]:
        """Write the joints of a posture that are wanted, in up to four tables."""
        robot, found = self._robot, {name: {} for name in ("both", "left", "right", "middle")}
        for left in self._sides.left:
            right, name = int(robot.mirror_index[left]), self._sides.name(left)
            mirrored = robot.mirror_sign[left] * key[right]
            if not wanted & {left, right}:
                continue
            if abs(key[left] - mirrored) <= SYMMETRIC and not split:
                found["both"][name] = 0.5 * (key[left] + mirrored)
            else:
                found["left"][name], found["right"][name] = key[left], mirrored
        for joint in sorted(wanted):
            if robot.mirror_index[joint] == joint:
                found["middle"][robot.joint_names[joint]] = key[joint]
        return [f"{table} = {_inline(angles)}" for table, angles in found.items() if angles]


def _inline(angles: dict[str, float]) -> str:
    pairs = (f"{_key(n)} = {_number(math.degrees(a), DECIMALS)}" for n, a in angles.items())
    return f"{{ {', '.join(pairs)} }}"


def _round(key: Array) -> Array:
    return np.asarray(np.round(np.degrees(key), DECIMALS), dtype=float)


def _number(value: float, decimals: int) -> str:
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}".rstrip("0").rstrip(".")


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else _text(name)


def _format_all(keyframes: Iterable[Keyframes], robot: Robot) -> str:
    return "\n".join(format_keyframes(each, robot) for each in keyframes)


def _read(path: Path) -> str:
    return read_bounded(path, MAX_TEXT).decode("utf-8")


def _write(path: Path, text: str, robot: Robot) -> None:
    """Write a file and read it again before it replaces the old one."""
    with atomic_path(path) as partial:
        partial.write_text(text, "utf-8")
        try:
            load_keyframes(partial, robot)
        except KeyframesError as error:
            raise KeyframesError(str(error).replace(str(partial), str(path))) from error
