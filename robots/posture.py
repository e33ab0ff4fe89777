"""The posture of a robot: where its root is, how it is turned, how it is bent."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robots import quaternion
from robots.quaternion import Array
from robots.validation import is_number, outside, shown

if TYPE_CHECKING:
    from robots.robot import Robot

UNIT_TOLERANCE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Posture:
    """A posture {p, q, V} of [Lin12], section 4.1."""

    position: Array
    """Root position in the world [m], shape (3,)."""
    orientation: Array
    """Root orientation in the world, unit quaternion w x y z, shape (4,)."""
    joint_pos: Array
    """Joint angles [rad], shape (n,), in the robot's joint order."""

    def __post_init__(self) -> None:
        shapes = (self.position.shape, self.orientation.shape)
        if shapes != ((3,), (4,)) or self.joint_pos.ndim != 1:
            raise ValueError(f"a posture needs position (3,), orientation (4,): {shapes}")
        values = np.concatenate([self.position, self.orientation, self.joint_pos])
        if not np.all(np.isfinite(values)):
            raise ValueError("a posture holds only finite numbers")
        norm = float(np.linalg.norm(self.orientation))
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            raise ValueError(f"orientation has length {norm:.4f}, expected 1 (a unit quaternion)")

    @property
    def gravity_b(self) -> Array:
        """Return the direction of gravity in the root frame, shape (3,)."""
        return quaternion.gravity_in_body(self.orientation)

    def mirrored(self, robot: Robot) -> Posture:
        """Reflect left and right."""
        return Posture(
            position=self.position * np.array([1.0, -1.0, 1.0]),
            orientation=quaternion.mirror(self.orientation),
            joint_pos=robot.mirror_joints(self.joint_pos),
        )

    def to_json(self, robot: Robot) -> str:
        """Write as the text of a posture file."""
        return json.dumps(
            {
                "position": self.position.tolist(),
                "orientation": self.orientation.tolist(),
                "joint_pos": dict(zip(robot.joint_names, self.joint_pos.tolist(), strict=True)),
            },
            indent=1,
        )


def load_posture(path: Path, robot: Robot) -> Posture:
    """Load a posture file: {"position", "orientation", "joint_pos": {name: rad}}.

    Raises:
        ValueError: naming everything in the file that is wrong.
    """
    record, faults = _read_record(path)
    faults += _find_faults(record, robot)
    if faults:
        raise ValueError(f"posture file {path}: " + "; ".join(faults))
    return Posture(
        position=np.array(record["position"], dtype=float),
        orientation=quaternion.normalize(np.array(record["orientation"], dtype=float)),
        joint_pos=np.array([record["joint_pos"][name] for name in robot.joint_names], dtype=float),
    )


def _read_record(path: Path) -> tuple[Any, list[str]]:
    """Read a JSON file; return its content, and the keys that it names twice as faults."""
    faults: list[str] = []

    def keep(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        counts = Counter(key for key, _ in pairs)
        faults.extend(
            f"{shown(key)} is named {count} times, allowed once"
            for key, count in counts.items()
            if count > 1
        )
        return dict(pairs)

    try:
        # An integer is read as the float it becomes: one of 400 digits is inf.
        record = json.loads(path.read_text("utf-8"), object_pairs_hook=keep, parse_int=float)
    except OSError as error:
        raise ValueError(f"posture file {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"posture file {path}: not UTF-8 text (byte {error.start})") from error
    except RecursionError as error:
        raise ValueError(f"posture file {path}: not a posture (nested too deep)") from error
    except ValueError as error:
        raise ValueError(f"posture file {path}: not JSON ({error})") from error
    return record, faults


def _find_faults(record: Any, robot: Robot) -> list[str]:
    if not isinstance(record, dict):
        return ["not a JSON object"]
    faults = _vector_faults(record, "position", 3, "m")
    quaternion_faults = _vector_faults(record, "orientation", 4, "w x y z")
    faults += quaternion_faults
    if not quaternion_faults:
        norm = math.hypot(*record["orientation"])
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            length = f"{norm:.4f}" if norm < 1e3 else f"{norm:.3e}"
            faults.append(f"orientation has length {length}, expected 1 (a unit quaternion)")
    return faults + _joint_faults(record.get("joint_pos"), robot)


def _vector_faults(record: dict[str, Any], key: str, size: int, unit: str) -> list[str]:
    value = record.get(key)
    if not isinstance(value, list) or len(value) != size:
        told = f"is {shown(value)}" if key in record else "is missing"
        return [f"{key} {told}, allowed a list of {size} numbers ({unit})"]
    return [
        f"{key}[{i}] is {shown(x)}, allowed a finite number ({unit})"
        for i, x in enumerate(value)
        if not is_number(x)
    ]


def _joint_faults(angles: Any, robot: Robot) -> list[str]:
    if not isinstance(angles, dict):
        return [f"joint_pos is {shown(angles)}, allowed an object {{joint name: rad}}"]
    names = ", ".join(robot.joint_names)
    faults = [f"joint '{name}' is missing" for name in robot.joint_names if name not in angles]
    unknown = [name for name in angles if name not in robot.joint_names]
    faults += [f"unknown joint {shown(name)}, allowed {names}" for name in unknown]
    for joint in robot.joints:
        if joint.name not in angles:
            continue
        angle = angles[joint.name]
        if not is_number(angle):
            faults.append(f"joint '{joint.name}' is {shown(angle)}, allowed a finite angle in rad")
        elif not joint.lower <= angle <= joint.upper:
            told = outside(angle, joint.lower, joint.upper, "rad")
            faults.append(f"joint '{joint.name}' is {told}")
    return faults
