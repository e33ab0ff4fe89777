"""Options of `robots import` and `robots check`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.cli.options.shared import JsonOption
from humanoid_getup.cli.output import find_file_faults


@dataclass(frozen=True, kw_only=True)
class ImportRobot(JsonOption):
    """Make a robot folder from a model file: its own model, and a robot.toml whose guesses are
    marked."""

    model: Annotated[Positional[Path], arg(metavar="MODEL.xml|MODEL.urdf")]
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


@dataclass(frozen=True, kw_only=True)
class CheckRobot(JsonOption):
    """Check whether a robot's description is sound and its body able to get up; one finding a
    line, each with what to do."""

    robot: Annotated[Positional[str], arg(metavar="NAME|DIR")]
    """Name of a robot, or a folder with a robot.toml."""
    picture: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """Picture to write of the stance and of the deepest squat."""

    def find_faults(self) -> list[str]:
        """Report a file that cannot be written, too."""
        faults = super().find_faults()
        return faults if self.picture is None else faults + find_file_faults(self.picture)
