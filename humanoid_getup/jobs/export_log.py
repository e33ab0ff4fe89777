"""Exports a flight log for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import BadInputError, needing, refusing
from humanoid_getup.commands.inputs import load_robot_of
from humanoid_getup.jobs.requests.look import ExportLogRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from robots.storage.files import atomic_folder, describe

NANOSECOND = 1e-9  # s


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


def export_log(
    request: ExportLogRequest, report: Report | None = None, cancel: Cancel | None = None
) -> ExportedLog:
    """Write a flight log as a ROS 2 bag; its folder appears complete or not at all.

    Raises:
        BadInputError: if the log cannot be exported, or the folder not be written.
        CancelledError: if ``cancel`` ended it; then nothing is written.
    """
    ExportLogRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("reading")
    with refusing():
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
            summary = write_bag(record, robot, folder, request.bag_name, monitor)
    except OSError as error:
        raise BadInputError(f"--rosbag2 is {request.rosbag2}: {describe(error)}") from error
    return ExportedLog(
        log=request.log,
        bag=request.rosbag2,
        robot=record.robot,
        topics=summary.topics,
        started=record.started,
        duration_s=summary.duration * NANOSECOND,
        truncated=record.truncated,
        lost_bytes=record.lost_bytes,
    )
