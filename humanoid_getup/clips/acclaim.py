"""Acclaim files: a skeleton of bones (.asf), and the angles of their joints (.amc)."""

from __future__ import annotations

from collections.abc import Iterator
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

INCH = 0.0254  # m
RATE = 120.0  # Hz of CMU's recordings; the files do not say it
ORDER = "XYZ"  # of all turns
ROOT = "root"
ROOT_CHANNELS = ("tx", "ty", "tz", "rx", "ry", "rz")
CHANNELS = ("rx", "ry", "rz")  # of all other bones


@dataclass(frozen=True, kw_only=True)
class Bone:
    """A bone: it begins where its parent ends."""

    name: str
    direction: Array
    """In the rest pose, (3,)."""
    length: float
    axis: Rotation
    """Orientation of the frame in which its joint turns."""
    channels: tuple[str, ...]
    """Such as rx, in the order of the file."""


@dataclass(frozen=True)
class AcclaimSkeleton:
    """The bones of a body, parents before children."""

    bones: dict[str, Bone]
    parents: dict[str, str]
    unit: float
    """One unit of length [m]."""


def read_acclaim(file: Path, skeleton_file: Path, rate: float = RATE) -> Clip:
    """Read a clip (.amc) of a skeleton (.asf), recorded at a rate [Hz].

    Raises:
        OSError: if a file cannot be read.
        ValueError: if they are not Acclaim files, or do not belong together.
    """
    try:
        skeleton = _read_skeleton(read_lines(skeleton_file, MOST_OF_SKELETON))
    except READ_ERRORS as error:
        reason = explain(error)
        raise ValueError(f"skeleton {skeleton_file}: it is not an ASF file: {reason}") from error
    try:
        frames = _read_frames(read_lines(file), skeleton)
        still = {name: np.zeros((1, values.shape[1])) for name, values in frames.items()}
        joints, rest = _place(skeleton, frames), _place(skeleton, still)
    except READ_ERRORS as error:
        reason = explain(error)
        raise ValueError(f"clip {file}: it is no AMC file of {skeleton_file}: {reason}") from error
    return Clip(
        file=file,
        period=1.0 / rate,
        joints=joints,
        rest={name: path[0] for name, path in rest.items()},
        unit=skeleton.unit,
    )


def _read_skeleton(lines: list[str]) -> AcclaimSkeleton:
    sections: dict[str, list[list[str]]] = {}
    rows: list[list[str]] = []
    for line in lines:
        words = line.split("#")[0].split()
        if words and words[0].startswith(":"):
            rows = sections.setdefault(words[0][1:], [])
        elif words:
            rows.append(words)
    units = {row[0]: row[1] for row in sections["units"]}
    bones = {bone.name: bone for bone in _read_bones(sections["bonedata"])}
    parents: dict[str, str] = {}
    for parent, child in (
        (row[0], child) for row in sections["hierarchy"] if len(row) > 1 for child in row[1:]
    ):
        if parent != ROOT and parent not in parents:
            raise ValueError(
                f"bone '{parent}' has children before it is one, expected parents first"
            )
        if child in parents or child not in bones:
            raise ValueError(f"bone '{child}' is in the hierarchy, expected once, with its data")
        parents[child] = parent
    length = float(units["length"])
    if not 0.0 < length < np.inf:
        raise ValueError(f"the unit of length is {length:g}, expected above 0")
    return AcclaimSkeleton(bones=bones, parents=parents, unit=INCH / length)


def _read_bones(rows: list[list[str]]) -> Iterator[Bone]:
    facts: dict[str, list[str]] = {}
    for words in rows:
        if words == ["begin"]:
            facts = {}
        elif words == ["end"]:
            name, channels = facts["name"][0], tuple(facts.get("dof", ()))
            if not set(channels) <= set(CHANNELS) or len(set(channels)) < len(channels):
                raise ValueError(
                    f"bone '{name}' has dof {' '.join(channels)}, expected different ones of "
                    f"{', '.join(CHANNELS)}"
                )
            if facts["axis"][3:] not in ([], [ORDER]):
                raise ValueError(
                    f"bone '{name}' has axis {' '.join(facts['axis'])}, expected {ORDER}"
                )
            length = float(facts["length"][0])
            if not np.isfinite(length):
                raise ValueError(f"bone '{name}' has length {length:g}, expected a finite one")
            yield Bone(
                name=name,
                direction=_read_vector(name, facts, "direction"),
                length=length,
                axis=_turn(_read_vector(name, facts, "axis")),
                channels=channels,
            )
        else:
            facts[words[0]] = words[1:]


def _read_vector(bone: str, facts: dict[str, list[str]], key: str) -> Array:
    """Read three finite numbers of a bone."""
    values = np.array([float(value) for value in facts[key][:3]])
    if values.shape != (3,) or not np.isfinite(values).all():
        raise ValueError(f"bone '{bone}' has {key} {' '.join(facts[key])}, expected three numbers")
    return values


def _read_frames(lines: list[str], skeleton: AcclaimSkeleton) -> dict[str, Array]:
    """Read the values of each bone in all frames, (T, channels)."""
    rows: dict[str, list[str]] = {}
    for line in lines:
        name, *numbers = line.split(maxsplit=1)
        if numbers and name[0] not in "#:":
            rows.setdefault(name, []).append(numbers[0])
    if ROOT not in rows:
        raise ValueError("there is no root")
    count = len(rows[ROOT])
    check_size(count, len(skeleton.bones) + 1)
    frames = {}
    for name, texts in rows.items():
        channels = ROOT_CHANNELS if name == ROOT else skeleton.bones[name].channels
        if len(texts) != count:
            raise ValueError(f"bone '{name}' has {len(texts)} frames, expected {count}")
        try:
            frames[name] = read_numbers(texts, len(channels))
        except ValueError as error:
            raise ValueError(f"bone '{name}': {error}") from error
    return frames


def _place(skeleton: AcclaimSkeleton, frames: dict[str, Array]) -> dict[str, Array]:
    """Compute the beginning of each bone in all frames, (T, 3)."""
    count = len(frames[ROOT])
    ends = {ROOT: frames[ROOT][:, :3]}
    turns = {ROOT: _turn(frames[ROOT][:, 3:])}
    places: dict[str, Array] = {}
    for name, parent in skeleton.parents.items():
        bone = skeleton.bones[name]
        angles = np.zeros((count, 3))
        for k, channel in enumerate(bone.channels):
            if name in frames:
                angles[:, CHANNELS.index(channel)] = frames[name][:, k]
        turns[name] = turns[parent] * bone.axis * _turn(angles) * bone.axis.inv()
        places[name] = ends[parent]
        ends[name] = places[name] + turns[name].apply(bone.length * bone.direction)
    leaves = set(skeleton.parents) - set(skeleton.parents.values())
    return places | {f"{name} end": ends[name] for name in leaves}


def _turn(angles: Array) -> Rotation:
    """Turn about x, then y, then z of the fixed frame, by angles in degrees, (..., 3)."""
    return Rotation.from_euler(ORDER.lower(), angles, degrees=True)
