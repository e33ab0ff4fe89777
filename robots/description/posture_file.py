"""Posture files: a posture as JSON, every joint by its name."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from robots import quaternion
from robots.posture import MAX_DISTANCE, UNIT_TOLERANCE, Posture
from robots.robot import Robot
from robots.storage.validation import (
    Angle,
    name_missing_joints,
    name_unknown_joints,
    outside,
    parse_file,
    read_table,
    reading,
    shown,
)

Meters = Annotated[float, Meta(description="a finite number (m)")]
Component = Annotated[float, Meta(description="a finite number (w x y z)")]


@dataclass(frozen=True)
class _PostureFile:
    """The content of a posture file."""

    position: Annotated[tuple[Meters, Meters, Meters], Meta(description="a list of 3 numbers (m)")]
    orientation: Annotated[
        tuple[Component, Component, Component, Component],
        Meta(description="a list of 4 numbers (w x y z)"),
    ]
    joint_pos: Annotated[dict[str, Angle], Meta(description="an object {joint name: rad}")]


def load_posture(path: Path, robot: Robot, *, fill: Callable[[str], None] | None = None) -> Posture:
    """Load a posture file: {"position", "orientation", "joint_pos": {name: rad}}.

    Joints that it leaves out take the angles of the stance if ``fill`` is given, and ``fill`` is
    called with a line that names them; otherwise they are an error.
    """
    with reading(f"posture file {path}"):
        record, problems = parse_file(path, "JSON", _parse_json)
        if not isinstance(record, dict):
            raise ValueError("not a JSON object")
    read = read_table(_PostureFile, record, "", problems)
    norm = math.hypot(*read.orientation)
    if read.orientation and not abs(norm - 1.0) <= UNIT_TOLERANCE and math.isfinite(norm):
        length = f"{norm:.4f}" if norm < 1e3 else f"{norm:.3e}"
        problems.append(f"orientation has length {length}, expected 1 (a unit quaternion)")
    if any(abs(x) > MAX_DISTANCE for x in read.position):
        found = f"{max(read.position, key=abs):.4g} m"
        problems.append(f"position is {found}, expected at most {MAX_DISTANCE:g} m from the origin")
    names = robot.joint_names
    missing = [name for name in names if name not in read.joint_pos]
    if fill is not None and missing and isinstance(record.get("joint_pos"), dict):
        stance = dict(zip(names, robot.standing.joint_pos.tolist(), strict=True))
        read = replace(read, joint_pos=stance | read.joint_pos)
    if isinstance(record.get("joint_pos"), dict):
        problems += _check_joints(read.joint_pos, robot)
    if problems:
        raise ValueError(f"posture file {path}: " + "; ".join(problems))
    if fill is not None and missing:
        fill(f"posture file {path}: {', '.join(missing)} missing, taken from the stance")
    return Posture(
        position=np.array(read.position),
        orientation=quaternion.normalize(np.array(read.orientation)),
        joint_pos=np.array([read.joint_pos[name] for name in names]),
    )


def format_posture(posture: Posture, robot: Robot) -> str:
    """Write a posture as the text of a posture file."""
    return json.dumps(
        {
            "position": posture.position.tolist(),
            "orientation": posture.orientation.tolist(),
            "joint_pos": dict(zip(robot.joint_names, posture.joint_pos.tolist(), strict=True)),
        },
        indent=1,
    )


def _parse_json(text: str) -> tuple[Any, list[str]]:
    """Parse JSON; return its content, and a problem for each key that occurs twice."""
    problems: list[str] = []

    def keep(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        counts = Counter(key for key, _ in pairs)
        problems.extend(
            f"{shown(key)} is named {count} times, expected once"
            for key, count in counts.items()
            if count > 1
        )
        return dict(pairs)

    # An integer is read as the float it becomes: one of 400 digits is inf.
    return json.loads(text, object_pairs_hook=keep, parse_int=float), problems


def _check_joints(angles: dict[str, float], robot: Robot) -> list[str]:
    names = robot.joint_names
    problems = name_missing_joints([name for name in names if name not in angles], robot.n)
    problems += name_unknown_joints([name for name in angles if name not in names], names)
    problems += [
        f"joint '{joint.name}' is {outside(angle, joint.lower, joint.upper, 'rad')}"
        for joint in robot.joints
        for angle in [angles.get(joint.name, math.nan)]
        if angle < joint.lower or angle > joint.upper
    ]
    return problems
