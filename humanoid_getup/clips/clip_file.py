"""Motion capture files: BVH, Acclaim's skeletons (.asf) with their clips (.amc), DeepMimic's.

A BVH file has a skeleton as nested joints, then a line of channels for each frame; Acclaim a
skeleton of bones, and the angles of their joints. DeepMimic's are in `deepmimic`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.clip import Clip
from humanoid_getup.clips.deepmimic import read_deepmimic
from humanoid_getup.clips.layout import measure_layout
from humanoid_getup.clips.recording import (
    MOST_OF_SKELETON,
    READ_ERRORS,
    Recording,
    check_size,
    explain,
    place_joints,
    read_lines,
    read_numbers,
)
from robots.quaternion import Array
from robots.storage.validation import reading

BVH, ACCLAIM, SKELETON = ".bvh", ".amc", ".asf"
DEEPMIMIC = (".txt", ".json")
CLIPS = (BVH, ACCLAIM, *DEEPMIMIC)


def read_clip(
    file: Path,
    skeleton: Path | None = None,
    *,
    rate: float | None = None,
    unit: float | None = None,
    up: str | None = None,
    renames: Mapping[str, str] | None = None,
) -> Clip:
    """Read a clip; the skeleton of an .amc may be the .asf file beside it.

    Given may be the frames per second of an .amc clip [Hz], the unit of length [m], the axis that
    points up, and new names of joints; unit and axis are else measured from the body.
    """
    kind = file.suffix.lower()
    if kind == BVH:
        recording = read_bvh(file)
    elif kind in DEEPMIMIC:
        recording = read_deepmimic(file)
    else:
        skeleton = skeleton or file.with_name(f"{file.stem.split('_')[0]}{SKELETON}")
        recording = read_acclaim(file, skeleton, rate or RATE)
    return measure_layout(recording, unit, up, renames or {})


HIERARCHY, MOTION = "HIERARCHY", "MOTION"
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


def read_bvh(file: Path) -> Recording:
    """Read a BVH file."""
    try:
        lines = read_lines(file)
        head = _find_motion(lines)
        joints = _read_joints(" ".join(lines[:head]).split())
        check_size(len(lines) - head, len(joints))
        channels = sum(len(joint.channels) for joint in joints)
        period, frames = _read_motion(lines[head + 1 :], channels)
        places, rest = _place_joints(joints, frames)
    except READ_ERRORS as error:
        raise ValueError(f"clip {file}: it is not a BVH file: {explain(error)}") from error
    return Recording(file=file, period=period, joints=places, rest=rest)


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


def _read_joints(words: list[str]) -> list[BvhJoint]:
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


def _read_motion(lines: list[str], channels: int) -> tuple[float, Array]:
    if len(lines) < 3 or not lines[0].startswith("Frames:"):
        raise ValueError("the frames are missing")
    count, period = int(lines[0].split()[1]), float(lines[1].split()[-1])
    if count != len(lines) - 2:
        raise ValueError(f"it has {len(lines) - 2} frames, expected {count} as it says")
    return period, read_numbers(lines[2:], channels)


def _place_joints(
    joints: list[BvhJoint], frames: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Compute the position of each joint in all frames, (T, 3), and with all angles zero, (3,).

    Position channels replace a joint's OFFSET, unless their length shows that they are to be added.
    """
    offsets: list[Array] = []
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
        length = np.linalg.norm(np.median(moved, axis=0))
        if joint.parent >= 0 and length < 0.5 * np.linalg.norm(joint.offset):
            moved += joint.offset
        own = Rotation.identity(len(frames))
        if angles:
            own = Rotation.from_euler(axes, np.stack(angles, axis=-1), degrees=True)
        offsets.append(moved)
        turns.append(own)
    names, parents = [joint.name for joint in joints], [joint.parent for joint in joints]
    return place_joints(names, parents, offsets, turns)


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


def read_acclaim(file: Path, skeleton_file: Path, rate: float = RATE) -> Recording:
    """Read a clip (.amc) of a skeleton (.asf), recorded at a rate [Hz]."""
    try:
        skeleton = _read_skeleton(read_lines(skeleton_file, MOST_OF_SKELETON))
    except READ_ERRORS as error:
        reason = explain(error)
        raise ValueError(f"skeleton {skeleton_file}: it is not an ASF file: {reason}") from error
    try:
        frames = _read_frames(read_lines(file), skeleton)
        still = {name: np.zeros((1, values.shape[1])) for name, values in frames.items()}
        joints, rest = _place_bones(skeleton, frames), _place_bones(skeleton, still)
    except READ_ERRORS as error:
        reason = explain(error)
        raise ValueError(f"clip {file}: it is no AMC file of {skeleton_file}: {reason}") from error
    return Recording(
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
        with reading(f"bone '{name}'"):
            frames[name] = read_numbers(texts, len(channels))
    return frames


def _place_bones(skeleton: AcclaimSkeleton, frames: dict[str, Array]) -> dict[str, Array]:
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
