"""Tables of keys in CSV: a column ``time`` [s], and one a joint in rad, or ``JOINT_deg``."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from humanoid_getup.motions.importing.key_sequence import MOST_KEYS, KeyCollector, KeySequence
from robots import Robot
from robots.quaternion import Array
from robots.storage.validation import name_unknown_joints, parse_file, shown

TIME = "time"
DEGREES = "_deg"


def load_key_table(path: Path, robot: Robot) -> KeySequence:
    """Read a table as keys of a robot, one each row.

    Raises:
        ValueError: naming what is wrong with the file.
    """
    try:
        header, *rows = parse_file(path, "CSV", _read_rows) or [[]]
        if not rows:
            raise ValueError("no keys, expected a header and one row or more")
        joints = _find_joints(header, robot)
        table = _read_numbers(header, rows)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
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
