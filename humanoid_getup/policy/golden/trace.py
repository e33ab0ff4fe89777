"""A recorded run of a policy, policy step by policy step, from its first step on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from robots import quaternion
from robots.quaternion import Array
from robots.storage.arrays import (
    ArchiveError,
    load_arrays,
    save_arrays,
    to_numbers,
    to_text,
)
from robots.storage.files import describe
from robots.storage.validation import parse_file

FEWEST_ROWS = 8  # of which each check still tells one fault from another
LARGEST = 1e12  # of any number: a time may be seconds since 1970
NORM_SLACK = 0.01  # of an orientation's length
TEXT_KEYS = ("robot", "joints")
NUMBER_KEYS = {
    "time": (),
    "orientation": (4,),
    "gyro": (3,),
    "joint_pos": ("n",),
    "joint_vel": ("n",),
    "observation": ("size",),
    "action": ("k",),
}
OPTIONAL_KEYS = {
    "target": ("n",),
    "sent": ("n",),
    "torque": ("n",),
    "effort": ("steps", "n"),
    "position": (3,),
    "velocity": (3,),
    "true_orientation": (4,),
    "true_gyro": (3,),
    "true_joint_pos": ("n",),
    "true_joint_vel": ("n",),
}
"""Keys of the arrays, and their shapes behind the first axis, which is the rows."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GoldenTrace:
    """T policy steps of a robot with n joints; the first one is the first after a reset."""

    robot: str
    joints: tuple[str, ...]
    """The robot's names of the joints, in the order of all arrays but observation and action."""
    time: Array
    """Beginnings of the policy steps [s], shape (T,)."""
    orientation: Array
    """Torso frame to world as it is measured, w x y z, shape (T, 4)."""
    gyro: Array
    """Angular velocity in the torso frame [rad/s], shape (T, 3)."""
    joint_pos: Array
    """Measured angles [rad], shape (T, n)."""
    joint_vel: Array
    """Measured speeds [rad/s], shape (T, n)."""
    observation: Array
    """What the network got, in its own order, shape (T, size)."""
    action: Array
    """What the network returned, shape (T, k)."""
    target: Array | None = None
    """Joint targets at the end of the policy step [rad], shape (T, n)."""
    sent: Array | None = None
    """Joint targets at its beginning [rad], shape (T, n); ``None``: as ``target``."""
    torque: Array | None = None
    """Torques at its beginning [N·m], shape (T, n)."""
    effort: Array | None = None
    """Mean torques in equal parts of it [N·m], shape (T, parts, n); ``None``: as ``torque``."""
    position: Array | None = None
    """True position of the torso in the world [m], shape (T, 3)."""
    velocity: Array | None = None
    """True velocity of the torso in the world [m/s], shape (T, 3)."""
    true_orientation: Array | None = None
    """True orientation, shape (T, 4); ``None``: as measured, as with the three below."""
    true_gyro: Array | None = None
    """[rad/s], shape (T, 3)"""
    true_joint_pos: Array | None = None
    """[rad], shape (T, n)"""
    true_joint_vel: Array | None = None
    """[rad/s], shape (T, n)"""

    def __len__(self) -> int:
        return len(self.time)

    @property
    def gravity(self) -> Array:
        """Return the direction of gravity in the torso frame, (T, 3)."""
        return quaternion.gravity_in_body(self.orientation)

    def save(self, file: Path) -> None:
        """Write it as an .npz file."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {key: value for key, value in values.items() if value is not None}
        save_arrays(file, arrays | {"joints": np.array(self.joints)})

    @staticmethod
    def load(file: Path) -> GoldenTrace:
        """Read an .npz file, or a .json file with the same keys.

        Raises:
            OSError: if it cannot be read.
            ArchiveError: if it is damaged, or naming what is missing or wrong.
        """
        keys = (*TEXT_KEYS, *NUMBER_KEYS)
        if file.suffix == ".json":
            return _check(_load_json(file, keys))
        return _check(load_arrays(file, keys, optional=tuple(OPTIONAL_KEYS)))


def _load_json(file: Path, keys: tuple[str, ...]) -> dict[str, Any]:
    try:
        record = parse_file(file, "JSON", json.loads, max_bytes=64 * 2**20)
    except ValueError as error:
        raise ArchiveError(describe(error)) from error
    if not isinstance(record, dict):
        raise ArchiveError("it is no JSON object")
    problems = [f"key '{key}' is missing" for key in keys if key not in record]
    problems += [f"unknown key '{key:.40}'" for key in record if key not in {*keys, *OPTIONAL_KEYS}]
    if problems:
        raise ArchiveError("; ".join(problems[:20]))
    return {key: _to_array(value, key) for key, value in record.items()}


def _to_array(value: Any, key: str) -> Any:
    try:
        return np.array(value)
    except ValueError:
        raise ArchiveError(f"{key} has rows of different lengths") from None


def _check(arrays: Mapping[str, Any]) -> GoldenTrace:
    names = arrays["joints"]
    if names.ndim != 1 or names.dtype.kind != "U" or not len(names):
        raise ArchiveError("joints is not a list of names")
    sizes = {"n": len(names)}
    rows = arrays["time"].shape[0] if arrays["time"].ndim else 0
    if rows < FEWEST_ROWS:
        raise ArchiveError(f"it has {rows} rows, expected at least {FEWEST_ROWS}")
    numbers = {}
    for key, shape in (NUMBER_KEYS | OPTIONAL_KEYS).items():
        if key in arrays:
            expected = tuple(sizes.get(size) if isinstance(size, str) else size for size in shape)
            numbers[key] = to_numbers(arrays[key], key, (rows, *expected))
            if np.abs(numbers[key]).max(initial=0.0) > LARGEST:
                raise ArchiveError(f"{key} has numbers beyond {LARGEST:g}")
    if np.any(np.diff(numbers["time"]) <= 0.0):
        raise ArchiveError("time does not increase")
    for key in ("orientation", "true_orientation"):
        if key in numbers and np.abs(np.linalg.norm(numbers[key], axis=1) - 1.0).max() > NORM_SLACK:
            raise ArchiveError(f"{key} is not of length 1, expected quaternions w x y z")
    return GoldenTrace(
        robot=to_text(arrays["robot"], "robot"), joints=tuple(map(str, names)), **numbers
    )
