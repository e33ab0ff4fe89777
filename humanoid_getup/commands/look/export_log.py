"""`getup log export`: a flight log as a ROS 2 bag."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError, needing
from humanoid_getup.commands.files import FOLDER, READ, ROBOT, find_new_folder_problems
from humanoid_getup.commands.inputs import load_robot_of
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.progress.callback import ProgressMonitor
from robots.storage.files import atomic_folder, describe

NANOSECOND = 1e-9  # s


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

    def _find_problems(self) -> Iterator[str]:
        problems = [*super()._find_problems()]
        yield from problems or find_new_folder_problems(self.rosbag2, "--rosbag2")


@dataclass(frozen=True, kw_only=True)
class ExportedLog:
    """A flight log that was exported."""

    log: Path
    bag: Path
    """Folder of the bag."""
    robot: str
    topics: dict[str, int]
    """Number of messages of each topic."""
    started: str
    """Date and time of the start, ISO 8601, UTC."""
    duration_s: float
    truncated: bool
    """Whether the log is incomplete, as after a kill, or damaged."""
    lost_bytes: int
    """Bytes that could not be read."""


@command("log export", json=True)
def export_log(request: ExportLogRequest, monitor: ProgressMonitor) -> ExportedLog:
    """Write a flight log as a ROS 2 bag; its folder appears complete or not at all."""
    monitor.begin("reading")
    record = FlightRecord.load(request.log)
    robot = load_robot_of(request, record.robot, f"flight log {request.log}")
    record.check_robot(robot)
    if not record.cycles:
        raise ValueError(f"flight log {request.log}: contains no cycle, expected at least one")
    with needing("ros"):
        from humanoid_getup.ros.rosbag import write_bag
    monitor.begin("writing")
    try:
        with atomic_folder(request.rosbag2) as folder:
            topics = write_bag(record, robot, folder, request.bag_name, monitor)
    except OSError as error:
        raise BadInputError(f"--rosbag2 is {request.rosbag2}: {describe(error)}") from error
    return ExportedLog(
        log=request.log,
        bag=request.rosbag2,
        robot=record.robot,
        topics=topics,
        started=record.started,
        duration_s=int(np.ptp(record.wall_time)) * NANOSECOND,
        truncated=record.truncated,
        lost_bytes=record.lost_bytes,
    )


@export_log.show
def _print(found: ExportedLog, _: ExportLogRequest, console: Console) -> None:
    cut = f", cut off or damaged: {found.lost_bytes} bytes lost" if found.truncated else ""
    console.print(f"{found.robot}, {found.started}, {found.duration_s:.2f} s{cut}", markup=False)
    for topic, count in found.topics.items():
        console.print(f" {topic}: {count} messages", markup=False)
    following = f"ros2 bag info {shlex.quote(str(found.bag))}"
    console.print(f"written to {found.bag}; next: {following}", markup=False, soft_wrap=True)
