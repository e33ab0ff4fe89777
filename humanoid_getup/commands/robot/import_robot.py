"""`getup robots import`: a robot folder from a model file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.files import READ
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.progress.callback import ProgressMonitor
from robots import load_robot
from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.robot_folder import write_robot

ROBOT_NAME = re.compile(r"[\w-][\w.-]{0,99}")
PLAIN = "1 to 100 letters, digits, '_', '-' or '.', not '.' first"


@dataclass(frozen=True, kw_only=True)
class ImportRequest(CommandRequest):
    """Make a robot folder from a model file: its own model, and a robot.toml whose guesses are
    marked."""

    model: Annotated[Positional[Path], READ, arg(metavar="MODEL.xml|MODEL.urdf")]
    """MJCF or URDF file of a humanoid that stands upright, z up."""
    out: Annotated[Path, arg(metavar="DIR")]
    """Folder to make; it must not exist or be empty."""
    name: str = ""
    """Name of the robot; default: that of the folder."""
    servo: Annotated[tuple[str, ...], arg(metavar="TYPE[=PATTERN],...")] = ()
    """Servo types of all joints, or of those whose names match a pattern such as '*knee*'; the last
    that matches counts. Default: the types nearest to what the model states."""
    fix: Annotated[tuple[str, ...], arg(metavar="JOINT,...")] = ()
    """Joints without servo, which are fixed where they stand."""
    meshes: bool = False
    """Keep meshes as convex hulls, instead of fitting boxes and capsules to them."""

    @property
    def robot_name(self) -> str:
        """Return the name of the robot."""
        return self.name or self.out.resolve().name

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if ROBOT_NAME.fullmatch(self.robot_name):
            return
        option = f"--name is '{self.name}'" if self.name else f"--out is '{self.out}'"
        named = "" if self.name else ", or --name with it"
        yield f"{option}, expected a name of {PLAIN}{named}"


class RobotImport(msgspec.Struct, frozen=True, kw_only=True):
    """Findings in a model file."""

    name: str
    dof: int
    mass: float = msgspec.field(name="mass_kg")
    torso: str
    pairs: int
    """Number of joints that have a mirror image."""
    servos: tuple[str, ...]
    """Servo types, each once."""
    supply_voltage: float
    """[V]"""
    stance_error: float
    rising_joints: tuple[str, ...]
    notes: tuple[str, ...]
    """Messages: changes, and what could not be found."""
    guesses: tuple[str, ...]
    """Guesses, and how to confirm each."""


@command("robots import", json=True)
def import_robot(request: ImportRequest, monitor: ProgressMonitor) -> RobotImport:
    """Make a robot's folder from a model file; it appears complete or not at all."""
    options = ImportOptions(
        name=request.robot_name,
        servos=request.servo,
        keep_hulls=request.meshes,
        fixed=request.fix,
    )
    monitor.begin("reading the model")
    robot = import_model(request.model, options)
    monitor.check()
    write_robot(robot, request.out)
    load_robot(request.out)
    return RobotImport(
        name=robot.options.name,
        dof=len(robot.joints),
        mass=float(np.sum(robot.spec.compile().body_mass)),
        torso=robot.torso,
        pairs=sum(k != mirror for k, mirror in enumerate(robot.mirror)) // 2,
        servos=tuple(dict.fromkeys(robot.servos.types)),
        supply_voltage=robot.servos.supply,
        stance_error=robot.stance.error,
        rising_joints=tuple(robot.rising_joints),
        notes=tuple(robot.notes),
        guesses=tuple(robot.guesses),
    )


@import_robot.show
def _print(found: RobotImport, request: ImportRequest, console: Console) -> None:
    console.print(
        f"{found.name}: {found.dof} joints, {found.mass:.2f} kg, torso '{found.torso}', servos "
        f"{', '.join(found.servos)} at {found.supply_voltage:g} V",
        markup=False,
    )
    for title, lines in (("note", found.notes), ("guessed", found.guesses)):
        for line in lines:
            console.print(f"{title}: {line}", markup=False)
    console.print(f"written to {request.out}; next: getup robots check {request.out}", markup=False)
