"""Animations in JSON, in the format of the Bit-Bots' soccer robots.

An object with a name and ``keyframes``: each has ``goals`` (degrees by joint name), the time in
which they are reached and that for which they are held, ``duration`` (1 if left out) and ``pause``
(0) [s], and may switch joints off in ``torque`` or correct them in ``stabilization_functions``.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from humanoid_getup.motions.importing.key_sequence import KeyCollector, KeySequence
from humanoid_getup.motions.importing.trajectory_file import is_trajectory, load_trajectory
from robots import Robot
from robots.storage.validation import name_unknown_joints, parse_file, read_table

Seconds = Annotated[float, Meta(ge=0.0, description="0 s or more")]
Goals = dict[str, Annotated[float, Meta(description="a finite angle in degrees")]]


@dataclass(frozen=True, kw_only=True)
class _Keyframe:
    goals: Goals
    duration: Seconds = 1.0
    pause: Seconds = 0.0
    torque: dict[str, Any] = field(default_factory=dict)
    stabilization_functions: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Animation:
    keyframes: tuple[_Keyframe, ...]
    name: str = ""


def load_animation(path: Path, robot: Robot) -> KeySequence:
    """Read an animation as keys of a robot; a trajectory in JSON is read as such.

    Raises:
        ValueError: naming all that is wrong with the file.
    """
    problems: list[str] = []
    try:
        content = parse_file(path, "JSON", json.loads)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if is_trajectory(content):
        return load_trajectory(path, robot)
    if not isinstance(content, dict):
        raise ValueError(f"{path}: expected an object with keyframes")
    animation = read_table(_Animation, content, "", problems)
    given = [name for keyframe in animation.keyframes for name in keyframe.goals]
    unknown = [name for name in dict.fromkeys(given) if name not in robot.joint_names]
    problems += name_unknown_joints(unknown, robot.joint_names)
    if problems:
        raise ValueError(f"{path}: {'; '.join(problems)}")
    collector, names = KeyCollector(robot=robot), robot.joint_names
    for keyframe in animation.keyframes:
        angles = {names.index(name): math.radians(a) for name, a in keyframe.goals.items()}
        collector.add(keyframe.duration, angles, keyframe.pause)
    notes = _find_notes(animation)
    return collector.finish(animation.name or path.stem, path.name, notes)


def _find_notes(animation: _Animation) -> tuple[str, ...]:
    notes = []
    if released := {n for k in animation.keyframes for n, on in k.torque.items() if not on}:
        listed = ", ".join(f"'{name}'" for name in sorted(released))
        notes.append(f"joints {listed} are released on the way: here they keep their targets")
    if any(keyframe.stabilization_functions for keyframe in animation.keyframes):
        notes.append("its stabilization functions are left out")
    return tuple(notes)
