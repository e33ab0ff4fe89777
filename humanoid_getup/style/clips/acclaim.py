"""Acclaim files: a skeleton of bones (.asf), and the angles of their joints (.amc)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from humanoid_getup.style.clips.clip import Clip, ClipError
from robots.files import read_bounded
from robots.quaternion import Array

MOST_BYTES = 256 * 2**20
INCH = 0.0254  # m
RATE = 120.0  # Hz of CMU's recordings; the files do not say it
ROOT = "root"
ROOT_CHANNELS = ("tx", "ty", "tz", "rx", "ry", "rz")


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
class Skeleton:
    """The bones of a body, parents before children."""

    bones: dict[str, Bone]
    parents: dict[str, str]
    unit: float
    """One unit of length [m]."""


def read_acclaim(file: Path, skeleton_file: Path, rate: float = RATE) -> Clip:
    """Read a clip (.amc) of a skeleton (.asf), recorded at a rate [Hz].

    Raises:
        OSError: if a file cannot be read.
        ClipError: if they are not Acclaim files, or do not belong together.
    """
    try:
        skeleton = _read_skeleton(_read(skeleton_file))
    except (ValueError, IndexError, KeyError) as error:
        raise ClipError(f"skeleton {skeleton_file}: it is not an ASF file: {error}") from error
    try:
        frames = _read_frames(_read(file), skeleton)
    except (ValueError, IndexError, KeyError) as error:
        raise ClipError(f"clip {file}: it is no AMC file of {skeleton_file}: {error}") from error
    still = {name: np.zeros((1, values.shape[1])) for name, values in frames.items()}
    return Clip(
        file=file,
        period=1.0 / rate,
        joints=_place(skeleton, frames),
        rest={name: path[0] for name, path in _place(skeleton, still).items()},
        unit=skeleton.unit,
    )


def _read(file: Path) -> list[str]:
    return read_bounded(file, MOST_BYTES).decode("utf-8").splitlines()


def _read_skeleton(lines: list[str]) -> Skeleton:
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
    pairs = [(row[0], child) for row in sections["hierarchy"] for child in row[1:]]
    return Skeleton(
        bones=bones,
        parents={child: parent for parent, child in pairs},
        unit=INCH / float(units["length"]),
    )


def _read_bones(rows: list[list[str]]) -> Iterator[Bone]:
    facts: dict[str, list[str]] = {}
    for words in rows:
        if words == ["begin"]:
            facts = {}
        elif words == ["end"]:
            angles = [float(value) for value in facts["axis"][:3]]
            yield Bone(
                name=facts["name"][0],
                direction=np.array([float(value) for value in facts["direction"]]),
                length=float(facts["length"][0]),
                axis=_turn(np.array(angles)),
                channels=tuple(facts.get("dof", ())),
            )
        else:
            facts[words[0]] = words[1:]


def _read_frames(lines: list[str], skeleton: Skeleton) -> dict[str, Array]:
    """Read the values of each bone in all frames, (T, channels)."""
    values: dict[str, list[list[float]]] = {}
    for line in lines:
        words = line.split()
        if not words or words[0][0] in "#:" or len(words) == 1:
            continue
        values.setdefault(words[0], []).append([float(word) for word in words[1:]])
    frames = {name: np.array(rows) for name, rows in values.items()}
    if ROOT not in frames:
        raise ValueError("there is no root")
    for name, rows in frames.items():
        width = len(ROOT_CHANNELS if name == ROOT else skeleton.bones[name].channels)
        if rows.shape != (len(frames[ROOT]), width):
            raise ValueError(f"bone '{name}' has {rows.shape}, expected {width} numbers a frame")
    return frames


def _place(skeleton: Skeleton, frames: dict[str, Array]) -> dict[str, Array]:
    """Compute where each bone begins in all frames, (T, 3)."""
    count = len(frames[ROOT])
    ends = {ROOT: frames[ROOT][:, :3]}
    turns = {ROOT: _turn(frames[ROOT][:, 3:])}
    places: dict[str, Array] = {}
    for name, parent in skeleton.parents.items():
        bone = skeleton.bones[name]
        angles = np.zeros((count, 3))
        for k, channel in enumerate(bone.channels):
            if name in frames and channel.startswith("r"):
                angles[:, "xyz".index(channel[1])] = frames[name][:, k]
        turns[name] = turns[parent] * bone.axis * _turn(angles) * bone.axis.inv()
        places[name] = ends[parent]
        ends[name] = places[name] + turns[name].apply(bone.length * bone.direction)
    leaves = set(skeleton.parents) - set(skeleton.parents.values())
    return places | {f"{name} end": ends[name] for name in leaves}


def _turn(angles: Array) -> Rotation:
    """Turn about x, then y, then z of the fixed frame, by angles in degrees, (..., 3)."""
    return Rotation.from_euler("xyz", angles, degrees=True)
