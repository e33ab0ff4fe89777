"""Motions of DeepMimic's humanoid: frames of duration, root and joint orientations, as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.recording import (
    LONGEST_FRAME,
    MOST_BYTES,
    Recording,
    check_size,
    place_joints,
)
from robots.quaternion import Array
from robots.storage.validation import parse_file, reading

COLUMNS = 44
ROOT = slice(1, 4)  # columns of its position [m]
SMALL = 1e-6  # s, and of a quaternion's length
HINGE = (0.0, 0.0, 1.0)  # axis of knees and elbows
Row = Annotated[list[float], msgspec.Meta(min_length=COLUMNS, max_length=COLUMNS)]


class _Motion(msgspec.Struct, rename={"frames": "Frames"}):
    frames: Annotated[list[Row], msgspec.Meta(min_length=1)]


def _list_side(side: str, z: float, first: int, leg: int, arm: int) -> list[Joint]:
    """List the joints of a side, from a row and two columns on."""
    return [
        (f"{side}UpLeg", 0, (0.0, 0.0, 0.084887 * z), leg, 4),
        (f"{side}Leg", first, (0.0, -0.421546, 0.0), leg + 4, 1),
        (f"{side}Foot", first + 1, (0.0, -0.40987, 0.0), leg + 5, 4),
        (f"{side}ToeBase", first + 2, (0.1335, -0.0225, 0.0), 0, 0),
        (f"{side}Arm", 1, (-0.02405, 0.2435, 0.18311 * z), arm, 4),
        (f"{side}ForeArm", first + 4, (0.0, -0.274788, 0.0), arm + 4, 1),
        (f"{side}Hand", first + 5, (0.0, -0.258947, 0.0), 0, 0),
    ]


Joint = tuple[str, int, tuple[float, float, float], int, int]
"""Name, row of the parent, offset from it [m] (x forward, y up, z right), first column, columns:
four of a quaternion w x y z, one of an angle [rad], none of an end."""
JOINTS: list[Joint] = [
    ("Hips", -1, (0.0, 0.0, 0.0), 4, 4),
    ("Spine", 0, (0.0, 0.236151, 0.0), 8, 4),
    ("Neck", 1, (0.0, 0.223894, 0.0), 12, 4),
    *_list_side("Right", 1.0, 3, 16, 25),
    *_list_side("Left", -1.0, 10, 30, 39),
]


def read_deepmimic(file: Path) -> Recording:
    """Read a motion; frames of different duration are interpolated."""
    with reading(f"clip {file}"):
        motion = parse_file(file, "a motion of DeepMimic", _decode, MOST_BYTES)
        frames = np.array(motion.frames)
        lasts = np.append(frames[:-1, 0], frames[0, 0])  # that of the last frame may be 0
        wrong = np.flatnonzero((lasts < SMALL) | (lasts > LONGEST_FRAME))
        if len(wrong):
            raise ValueError(
                f"frame {wrong[0] + 1} lasts {lasts[wrong[0]]:g} s, expected {SMALL:g} to "
                f"{LONGEST_FRAME:g} s"
            )
        period, time = float(np.median(lasts)), np.cumsum(lasts) - lasts
        check_size(round(time[-1] / period) + 1, len(JOINTS))
        even = period * np.arange(round(time[-1] / period) + 1)
        offsets = [np.tile(offset, (len(frames), 1)) for _, _, offset, _, _ in JOINTS]
        offsets[0] = frames[:, ROOT]
        turns = [_turn(name, frames, first, count) for name, _, _, first, count in JOINTS]
    names, parents = [joint[0] for joint in JOINTS], [joint[1] for joint in JOINTS]
    places, rest = place_joints(names, parents, offsets, turns)
    joints = {
        name: np.stack([np.interp(even, time, column) for column in rows.T], axis=-1)
        for name, rows in places.items()
    }
    return Recording(file=file, period=period, joints=joints, rest=rest, unit=1.0)


def _decode(text: str) -> _Motion:
    return msgspec.json.decode(text, type=_Motion)


def _turn(name: str, frames: Array, first: int, count: int) -> Rotation:
    values = frames[:, first : first + count]
    if count == 4:
        length = np.linalg.norm(values, axis=1)
        if length.min() < SMALL:
            raise ValueError(
                f"frame {length.argmin() + 1} has a quaternion of length 0 for {name} (numbers "
                f"{first + 1} to {first + 4}), expected length 1"
            )
        return Rotation.from_quat(values, scalar_first=True)
    return Rotation.from_rotvec(values * HINGE) if count else Rotation.identity(len(frames))
