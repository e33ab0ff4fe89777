"""BVH files: a skeleton as nested joints, then a line of channels for each frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.clip import (
    MOST_OF_SKELETON,
    READ_ERRORS,
    Clip,
    check_size,
    explain,
    read_lines,
    read_numbers,
)
from robots.quaternion import Array

HIERARCHY, MOTION = "HIERARCHY", "MOTION"
CENTIMETER = 0.01  # m; what BVH files are nearly always in
POSITION, ROTATION = "position", "rotation"


@dataclass(frozen=True)
class BvhJoint:
    """A joint of the skeleton."""

    name: str
    parent: int
    """Row of its parent; -1 for the root."""
    offset: Array
    """From its parent in the rest pose, (3,)."""
    channels: tuple[str, ...]
    """Such as Xposition or Zrotation, in order."""


def read_bvh(file: Path) -> Clip:
    """Read a clip.

    Raises:
        OSError: if the file cannot be read.
        ValueError: if it is no BVH file.
    """
    try:
        lines = read_lines(file)
        head = _find_motion(lines)
        joints = _read_skeleton(" ".join(lines[:head]).split())
        check_size(len(lines) - head, len(joints))
        channels = sum(len(joint.channels) for joint in joints)
        period, frames = _read_frames(lines[head + 1 :], channels)
        places = _place(joints, frames)
        still = np.zeros((1, frames.shape[1]))
        rest = {name: path[0] for name, path in _place(joints, still).items()}
    except READ_ERRORS as error:
        raise ValueError(f"clip {file}: it is not a BVH file: {explain(error)}") from error
    return Clip(file=file, period=period, joints=places, rest=rest, unit=CENTIMETER)


def _find_motion(lines: list[str]) -> int:
    """Find the line after the skeleton."""
    size = 0
    for number, line in enumerate(lines):
        if line.strip() == MOTION:
            return number
        size += len(line)
        if size > MOST_OF_SKELETON:
            raise ValueError(f"its skeleton has more than {MOST_OF_SKELETON} bytes")
    if not lines or lines[0].split()[0] != HIERARCHY:
        raise ValueError(f"{HIERARCHY} is missing")
    raise ValueError(f"{MOTION} is missing")


def _read_skeleton(words: list[str]) -> list[BvhJoint]:
    if not words or words[0] != HIERARCHY:
        raise ValueError(f"{HIERARCHY} is missing")
    joints: list[BvhJoint] = []
    open_rows: list[int] = []
    at, ends, name = 1, 0, ""
    offset = np.zeros(3)
    while at < len(words):
        word = words[at]
        if word in ("ROOT", "JOINT"):
            name, at = words[at + 1], at + 2
        elif word == "End":
            name, ends, at = f"{joints[open_rows[-1]].name} end {ends}", ends + 1, at + 2
        elif word == "{":
            joints.append(BvhJoint(name, open_rows[-1] if open_rows else -1, np.zeros(3), ()))
            open_rows.append(len(joints) - 1)
            at += 1
        elif word == "OFFSET":
            offset = np.array([float(value) for value in words[at + 1 : at + 4]])
            row = joints[open_rows[-1]]
            if offset.shape != (3,) or not np.isfinite(offset).all():
                raise ValueError(f"joint '{row.name}' has OFFSET {offset}, expected three numbers")
            joints[open_rows[-1]] = BvhJoint(row.name, row.parent, offset, row.channels)
            at += 4
        elif word == "CHANNELS":
            row, count = joints[open_rows[-1]], int(words[at + 1])
            names = _check_channels(row.name, count, words[at + 2 : at + 2 + max(count, 0)])
            joints[open_rows[-1]] = BvhJoint(row.name, row.parent, row.offset, names)
            at += 2 + count
        elif word == "}":
            open_rows.pop()
            at += 1
        else:
            raise ValueError(f"unexpected '{word[:40]}' in the skeleton")
    if not joints or open_rows:
        raise ValueError("the skeleton is not complete")
    return joints


def _check_channels(name: str, count: int, names: list[str]) -> tuple[str, ...]:
    """Check that a joint has positions and rotations about different axes, and nothing else."""
    kinds = [(word[:1].upper(), word[1:].lower()) for word in names]
    known = all(axis in ("X", "Y", "Z") and kind in (POSITION, ROTATION) for axis, kind in kinds)
    if count < 0 or len(names) != count or not known or len(set(kinds)) < len(kinds):
        raise ValueError(
            f"joint '{name}' has {count} channels {' '.join(names)[:80]}, expected different ones "
            "of Xposition to Zposition and Xrotation to Zrotation"
        )
    return tuple(names)


def _read_frames(lines: list[str], channels: int) -> tuple[float, Array]:
    if len(lines) < 3 or not lines[0].startswith("Frames:"):
        raise ValueError("the frames are missing")
    count, period = int(lines[0].split()[1]), float(lines[1].split()[-1])
    if count != len(lines) - 2:
        raise ValueError(f"it has {len(lines) - 2} frames, expected {count} as it says")
    return period, read_numbers(lines[2:], channels)


def _place(joints: list[BvhJoint], frames: Array) -> dict[str, Array]:
    """Compute the position of each joint in all frames, (T, 3)."""
    places: list[Array] = []
    turns: list[Rotation] = []
    at = 0
    for joint in joints:
        values = frames[:, at : at + len(joint.channels)]
        at += len(joint.channels)
        moved, angles, axes = np.tile(joint.offset, (len(frames), 1)), [], ""
        for value, channel in zip(values.T, joint.channels, strict=True):
            axis, kind = "XYZ".index(channel[0].upper()), channel[1:].lower()
            if kind == POSITION:
                moved[:, axis] = value
            else:
                angles.append(value)
                axes += channel[0].upper()
        own = Rotation.identity(len(frames))
        if angles:
            own = Rotation.from_euler(axes, np.stack(angles, axis=-1), degrees=True)
        if joint.parent < 0:
            places.append(moved)
            turns.append(own)
        else:
            places.append(places[joint.parent] + turns[joint.parent].apply(moved))
            turns.append(turns[joint.parent] * own)
    return {joint.name: place for joint, place in zip(joints, places, strict=True)}
