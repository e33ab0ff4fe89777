"""`getup robots export`: a robot's servos and controllers for ros2_control."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from drivers.errors import SetupError
from humanoid_getup.commands.command import command
from humanoid_getup.commands.files import FOLDER, ROBOT, find_new_folder_problems
from humanoid_getup.commands.inputs import make_torque_limit
from humanoid_getup.commands.options import TorqueOptions
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.ros.ros2_control import RobotControl
from robots import load_robot
from robots.storage.files import atomic_folder, describe

XACRO, CONTROLLERS = "ros2_control.xacro", "controllers.yaml"


@dataclass(frozen=True, kw_only=True)
class ExportRobotRequest(TorqueOptions):
    """Export a robot's servos for ros2_control: a xacro for dynamixel_hardware_interface, and the
    parameters of its controllers."""

    robot: Annotated[Positional[str], ROBOT, arg(metavar="NAME|DIR")]
    """Name of a robot, or a folder with a robot.toml."""
    ros2_control: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder to make; it must not exist or be empty."""

    def _find_problems(self) -> Iterator[str]:
        problems = [*super()._find_problems()]
        if self.limit_by == "ideal":
            problems.append("--limit-by is ideal, which no servo can, expected current or pwm")
        yield from problems or find_new_folder_problems(self.ros2_control, "--ros2-control")


@dataclass(frozen=True, kw_only=True)
class ExportedRobot:
    """A robot that was exported."""

    name: str
    files: tuple[Path, ...]
    notes: tuple[str, ...]
    """What the files cannot express."""


@command("robots export", json=True)
def export_robot(request: ExportRobotRequest, _: ProgressMonitor) -> ExportedRobot:
    """Write the files of a robot for ros2_control; their folder appears complete or not at all."""
    robot = load_robot(request.robot)
    try:
        control = RobotControl.of(robot, make_torque_limit(request, robot))
        with atomic_folder(request.ros2_control) as folder:
            (folder / XACRO).write_text(control.xacro, "utf-8")
            (folder / CONTROLLERS).write_text(control.controllers, "utf-8")
    except SetupError as error:
        raise ValueError(str(error)) from error
    except OSError as error:
        raise ValueError(f"--ros2-control is {request.ros2_control}: {describe(error)}") from error
    files = tuple(request.ros2_control / name for name in (XACRO, CONTROLLERS))
    return ExportedRobot(name=robot.name, files=files, notes=control.notes)


@export_robot.show
def _print(found: ExportedRobot, _: ExportRobotRequest, console: Console) -> None:
    for note in found.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    written = " and ".join(map(str, found.files))
    console.print(f"{found.name}: written to {written}", markup=False, soft_wrap=True)
