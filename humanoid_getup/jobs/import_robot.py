"""Imports a robot: a folder from a model file."""

from __future__ import annotations

import msgspec
import numpy as np

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.jobs.requests.robots import ImportRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from robots import RobotError, load_robot
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.model_import.source import ModelImportError


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


def import_robot(
    request: ImportRequest, report: Report | None = None, cancel: Cancel | None = None
) -> RobotImport:
    """Make a robot's folder from a model file; it appears complete or not at all.

    Raises:
        BadInputError: if there is no robot in the file, or the folder cannot be written.
        CancelledError: if ``cancel`` ended it before.
    """
    ImportRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    options = ImportOptions(
        name=request.robot_name,
        servos=request.servo,
        keep_hulls=request.meshes,
        fixed=request.fix,
    )
    monitor.begin("reading the model")
    try:
        robot = import_model(request.model, options)
        monitor.check()
        write_robot(robot, request.out)
        load_robot(request.out)
    except (ModelImportError, RobotError) as error:
        raise BadInputError(*error.problems) from error
    return _summarize(robot)


def _summarize(robot: ImportedRobot) -> RobotImport:
    model = robot.spec.compile()
    return RobotImport(
        name=robot.options.name,
        dof=len(robot.joints),
        mass=float(np.sum(model.body_mass)),
        torso=robot.torso,
        pairs=sum(k != mirror for k, mirror in enumerate(robot.mirror)) // 2,
        servos=tuple(dict.fromkeys(robot.servos.types)),
        supply_voltage=robot.servos.supply,
        stance_error=robot.stance.error,
        rising_joints=tuple(robot.rising_joints),
        notes=tuple(robot.notes),
        guesses=tuple(robot.guesses),
    )
