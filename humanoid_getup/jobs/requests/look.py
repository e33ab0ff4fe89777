"""Request to replay a flight log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.commands.files import FOLDER, READ, ROBOT, Written
from humanoid_getup.commands.options import BodyOption, JobRequest, RobotOption, SceneOptions
from humanoid_getup.commands.output_files import find_new_folder_problems
from humanoid_getup.commands.values import between

REPLAY_FILES = ("replay.json", "flight.png", "replay.png", "style.png")
LAST_PORT = 65535


@dataclass(frozen=True, kw_only=True)
class ReplayRequest(JobRequest):
    """Replay a flight log on the twin and report the differences."""

    log: Annotated[Positional[Path], READ, arg(metavar="LOG")]
    """A flight log (.mcap)."""
    robot: Annotated[str | None, ROBOT] = None
    """Name of a robot, or a folder with a robot.toml; default: the log's robot."""
    scene: Annotated[str | None, READ] = None
    """Name of a scene; default: the log's scene, else flat."""
    voltage: Annotated[float | None, between(1.0, 100.0, "V"), arg(metavar="V")] = None
    """Supply voltage of the twin [V]; default: as measured at the start."""
    threshold: Annotated[float | None, between(1e-9, 10.0, "rad"), arg(metavar="RAD")] = None
    """Difference of a joint or of the tilt from which the replay has diverged [rad];
    default: 0.05."""
    out: Annotated[Path | None, Written(REPLAY_FILES), arg(metavar="DIR")] = None
    """Folder for replay.json, flight.png and replay.png."""


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


@dataclass(frozen=True, kw_only=True)
class StudioRequest(BodyOption, SceneOptions):
    """Open the studio, a page in the browser: pose a fall, plan its rise, look at it."""

    port: Annotated[int, between(0, LAST_PORT, ""), arg(metavar="N")] = 8090
    """Port of the page; 0 for any that is free."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address at which the page is served; one that others can reach requires a token, which is
    part of the printed address."""
    folder: Annotated[tuple[Path, ...], arg(metavar="DIR,...")] = (Path(),)
    """Folders in which the page may read and write files, besides the robot's own, which it
    reads."""

    def find_problems(self) -> list[str]:
        """Report folders that do not exist as well."""
        missing = [folder for folder in self.folder if not folder.is_dir()]
        problems = [f"--folder {folder}: expected an existing folder" for folder in missing]
        return super().find_problems() + problems
