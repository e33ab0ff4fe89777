"""The content of a model file: a compiled model, its actuators, ties and a stance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from robots.model_import.ties import Fold, Tie

MOST_PARTS = 500  # joints, bodies or links of a robot; a servo bus has 253 ids
MAX_LIMIT = 4.0 * np.pi  # rad; a joint that turns farther was meant in degrees
MOST_INERTIA = 4500.0  # kg·m², of the heaviest robot, all of it as far away as the largest reaches


class ModelImportError(ValueError):
    """A model file cannot become a robot; the message has one problem a line."""

    def __init__(self, *problems: str) -> None:
        self.problems = problems
        super().__init__("; ".join(self.problems))


def check_size(path: Path, **counts: int) -> None:
    """Raise ModelImportError if a model has more parts of a kind than a robot has."""
    problems = [
        f"{path}: it has {count} {kind}, expected at most {MOST_PARTS}"
        for kind, count in counts.items()
        if count > MOST_PARTS
    ]
    if problems:
        raise ModelImportError(*problems)


def find_range_problems(lower: float, upper: float, hint: str) -> Iterator[str]:
    """Find limits of a hinge [rad] that it cannot have; equal ones are none."""
    if lower > upper:
        yield f"has limits from {lower:g} to {upper:g} rad, expected the lower one first"
    if (far := max(abs(lower), abs(upper))) > MAX_LIMIT:
        yield f"has a limit of {far:g} rad, expected at most {MAX_LIMIT:.1f} rad: {hint}"


def compile_spec(spec: mujoco.MjSpec, notes: list[str]) -> mujoco.MjModel:
    """Compile a model; flat meshes are treated as shells, with a note."""
    try:
        return spec.compile()
    except ValueError as error:
        if "mesh volume" not in str(error):
            raise
    notes.append("meshes are treated as shells, as some have no volume")
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return spec.compile()


@dataclass(frozen=True, kw_only=True)
class ActuatorFigures:
    """Limits of a joint's actuator as a model states them; None where it states none."""

    effort: float | None = None
    """Largest torque at the joint, or of the motor in front of its gear [N·m]."""
    speed: float | None = None
    """Largest speed of the joint [rad/s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelSource:
    """A model file as read."""

    path: Path
    model: mujoco.MjModel
    actuators: dict[str, ActuatorFigures]
    """Limits by joint name; empty if the model states none."""
    stance: dict[str, float] = field(default_factory=dict)
    """Angles of a keyframe by joint name [rad]; empty without keyframes."""
    ties: tuple[Tie, ...] = ()
    """Gears, tendons and mimics that are not in `folds`."""
    loops: tuple[tuple[int, int], ...] = ()
    """Pairs of bodies that closed loops join."""
    folds: tuple[Fold, ...] = ()
    """Drives whose motors' hinges were fixed; their actuators are under the driven joints."""
    flat: dict[str, str] = field(default_factory=dict)
    """Shapes without extent, which were left out, by the name of their body."""
    is_floating: bool = False
    """Whether a root without joint floats, as that of a URDF does."""
    notes: tuple[str, ...] = ()
    """Messages for the user about how it was read."""
