"""The content of a model file: a compiled model, its actuators, ties, drives and a stance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from robots.quaternion import Array

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


@dataclass(frozen=True)
class Tie:
    """Hinges that turn together: the sum of share times angle is constant."""

    joints: tuple[str, ...]
    shares: tuple[float, ...]
    is_loop: bool = False
    """Whether a closed loop ties them, so that the shares hold only near the model's pose."""

    @classmethod
    def follow(cls, follower: str, leader: str, ratio: float) -> Tie:
        """Tie a joint to another one by their ratio of turns."""
        return cls((follower, leader), (1.0, -ratio))


@dataclass(frozen=True, eq=False)
class Fold:
    """Motors that drive other hinges: one through a gear, or two through a coupling."""

    motors: tuple[str, ...]
    """Hinges with actuators, one or two."""
    joints: tuple[str, ...]
    """The hinges that they drive, each mainly by the motor with the same index."""
    rods: tuple[str, ...]
    """Hinges between them."""
    matrix: Array
    """Turns of the motors (rows) per turn of the joints (columns), (1, 1) or (2, 2)."""
    is_loop: bool
    """Whether rods close a loop, so that the matrix holds only near the model's pose."""

    @property
    def gear(self) -> float:
        """Return the turns of a single motor per turn of its joint, negative if it reverses."""
        return float(self.matrix[0, 0])

    def describe(self) -> str:
        """Describe it in a line."""
        joints, motors = " and ".join(self.joints), " and ".join(self.motors)
        by = "rods" if self.is_loop else "gears"
        measured = "; its ratio was measured in one pose and holds near it" if self.is_loop else ""
        fixed = ", ".join((*self.motors, *self.rods))
        return f"{joints} driven by {motors} through {by}: {fixed} fixed{measured}"


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
