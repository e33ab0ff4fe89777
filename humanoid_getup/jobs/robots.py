"""Exports a robot for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivers.errors import SetupError
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.inputs import make_torque_limit
from humanoid_getup.jobs.requests.robots import CheckRequest, ExportRobotRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.robot_check.check import RobotCheck
from humanoid_getup.robot_check.check import check_robot as check
from humanoid_getup.robot_check.finding import CheckFinding
from humanoid_getup.ros.ros2_control import RobotControl
from robots import Robot, RobotError, load_robot
from robots.storage.files import atomic_folder, describe

XACRO, CONTROLLERS = "ros2_control.xacro", "controllers.yaml"


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckedRobot:
    """A robot, and the findings of its check."""

    robot: Robot
    check: RobotCheck

    @property
    def findings(self) -> tuple[CheckFinding, ...]:
        """Return the findings, by part of the check."""
        return self.check.findings

    @property
    def is_sound(self) -> bool:
        """Return whether there is no fault."""
        return self.check.is_sound


def check_robot(
    request: CheckRequest, report: Report | None = None, cancel: Cancel | None = None
) -> CheckedRobot:
    """Check whether a robot's description is sound and its body able to get up."""
    CheckRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    try:
        robot = load_robot(request.robot)
        found = check(robot, lambda part: monitor.begin(f"checking {part}"))
    except ValueError as error:
        problems = error.problems if isinstance(error, RobotError) else [str(error)]
        raise BadInputError(*problems) from error
    return CheckedRobot(robot=robot, check=found)


@dataclass(frozen=True, kw_only=True)
class ExportedRobot:
    """A robot that was exported."""

    name: str
    files: tuple[Path, ...]
    notes: tuple[str, ...]
    """What the files cannot express."""


def export_robot(request: ExportRobotRequest) -> ExportedRobot:
    """Write the files of a robot for ros2_control; their folder appears complete or not at all."""
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
