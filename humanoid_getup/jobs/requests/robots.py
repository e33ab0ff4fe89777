"""Requests to import a robot from a model file, to check one, and to export one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.commands.files import FOLDER, READ, ROBOT
from humanoid_getup.commands.options import JobRequest, TorqueOptions
from humanoid_getup.commands.output_files import find_new_folder_problems

ROBOT_NAME = re.compile(r"[\w-][\w.-]{0,99}")
PLAIN = "1 to 100 letters, digits, '_', '-' or '.', not '.' first"


@dataclass(frozen=True, kw_only=True)
class ImportRequest(JobRequest):
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

    def find_problems(self) -> list[str]:
        """Report a name that no folder or file can have as well."""
        problems = super().find_problems()
        if ROBOT_NAME.fullmatch(self.robot_name):
            return problems
        option = f"--name is '{self.name}'" if self.name else f"--out is '{self.out}'"
        named = "" if self.name else ", or --name with it"
        return [*problems, f"{option}, expected a name of {PLAIN}{named}"]


@dataclass(frozen=True, kw_only=True)
class CheckRequest(JobRequest):
    """A robot to check."""

    robot: Annotated[Positional[str], ROBOT, arg(metavar="NAME|DIR")]
    """Name of a robot, or a folder with a robot.toml."""


@dataclass(frozen=True, kw_only=True)
class ExportRobotRequest(TorqueOptions):
    """Export a robot's servos for ros2_control: a xacro for dynamixel_hardware_interface, and the
    parameters of its controllers."""

    robot: Annotated[Positional[str], ROBOT, arg(metavar="NAME|DIR")]
    """Name of a robot, or a folder with a robot.toml."""
    ros2_control: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder to make; it must not exist or be empty."""

    def find_problems(self) -> list[str]:
        """Report a folder that is not new, and an ideal torque limit, as well."""
        problems = super().find_problems()
        if self.limit_by == "ideal":
            problems.append("--limit-by is ideal, which no servo can, expected current or pwm")
        return problems or find_new_folder_problems(self.ros2_control, "--ros2-control")
