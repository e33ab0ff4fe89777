"""Exports a robot for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivers.errors import SetupError
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import make_torque_limit
from humanoid_getup.jobs.requests.robots import ExportRobotRequest
from humanoid_getup.ros.ros2_control import RobotControl
from robots import load_robot
from robots.storage.files import atomic_folder, describe

XACRO, CONTROLLERS = "ros2_control.xacro", "controllers.yaml"


@dataclass(frozen=True, kw_only=True)
class ExportedRobot:
    """A robot that was exported."""

    name: str
    files: tuple[Path, ...]
    notes: tuple[str, ...]
    """What the files cannot express."""


def export_robot(request: ExportRobotRequest) -> ExportedRobot:
    """Write the files of a robot for ros2_control; their folder appears complete or not at all.

    Raises:
        BadInputError: if its servos are not on a bus of Dynamixels, or files cannot be written.
    """
    ExportRobotRequest.accept(request)
    with refusing():
        robot = load_robot(request.robot)
    limit = make_torque_limit(request, robot)
    try:
        with refusing():
            control = RobotControl.of(robot, limit)
        with atomic_folder(request.ros2_control) as folder:
            (folder / XACRO).write_text(control.xacro, "utf-8")
            (folder / CONTROLLERS).write_text(control.controllers, "utf-8")
    except SetupError as error:
        raise BadInputError(str(error)) from error
    except OSError as error:
        raise BadInputError(
            f"--ros2-control is {request.ros2_control}: {describe(error)}"
        ) from error
    files = tuple(request.ros2_control / name for name in (XACRO, CONTROLLERS))
    return ExportedRobot(name=robot.name, files=files, notes=control.notes)
