"""Request to export a flight log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.jobs.output_files import find_new_folder_problems
from humanoid_getup.jobs.requests.files import FOLDER, READ, ROBOT
from humanoid_getup.jobs.requests.shared import RobotOption


@dataclass(frozen=True, kw_only=True)
class ExportLogRequest(RobotOption):
    """Export a flight log as a ROS 2 bag: joints as measured and as commanded, and the IMU.

    It requires the extra `ros`, but no ROS.
    """

    log: Annotated[Positional[Path], READ, arg(metavar="LOG")]
    """A flight log (.mcap)."""
    rosbag2: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder of the bag; it must not exist or be empty."""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: the log's robot."""

    @property
    def bag_name(self) -> str:
        """Return the name of the bag."""
        return self.rosbag2.resolve().name or "bag"

    def find_problems(self) -> list[str]:
        """Report a folder that is not new as well."""
        return super().find_problems() or find_new_folder_problems(self.rosbag2, "--rosbag2")
