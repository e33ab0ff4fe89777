"""Exports a motion for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import find_motion, load_robot
from humanoid_getup.jobs.requests.motions import ExportMotionRequest
from humanoid_getup.ros.joint_trajectory import JointTrajectory
from robots.storage.files import write_atomically


@dataclass(frozen=True, kw_only=True)
class ExportedMotion:
    """A motion that was exported."""

    name: str
    robot: str
    file: Path
    points: int
    duration_s: float
    """From the first point, for a JointTrajectory the start of the approach, to the last one."""
    start_class: str
    end_class: str


def export_motion(request: ExportMotionRequest) -> ExportedMotion:
    """Write a motion as a JointTrajectory, or as CSV.

    Raises:
        BadInputError: if there is no such motion of the robot, or the file cannot be written.
    """
    ExportMotionRequest.accept(request)
    robot = load_robot(request)
    motion = find_motion(robot, request.motion)
    if request.trajectory is not None:
        file, trajectory = request.trajectory, JointTrajectory.of(motion, robot, request.approach)
        write = trajectory.to_json if file.suffix == ".json" else trajectory.to_yaml
        time, text = trajectory.time, write(goal=request.goal)
    else:
        assert request.csv is not None  # the request says so
        file, time = request.csv, motion.time - motion.time[0]
        header = ",".join(("time", *robot.joint_names))
        rows = (map(repr, row) for row in np.column_stack([time, motion.joint_target]).tolist())
        text = "\n".join((header, *map(",".join, rows))) + "\n"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, text)
    except OSError as error:
        raise BadInputError(f"output file {file}: {error.strerror}") from error
    return ExportedMotion(
        name=motion.name,
        robot=robot.name,
        file=file,
        points=len(time),
        duration_s=float(time[-1]),
        start_class=motion.start_class,
        end_class=motion.end_class,
    )
