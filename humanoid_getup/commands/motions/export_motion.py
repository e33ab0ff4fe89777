"""`getup motions export`: a motion as CSV, or as a JointTrajectory of ROS."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import WRITTEN
from humanoid_getup.commands.inputs import find_motion, load_robot
from humanoid_getup.commands.options import MotionName, RobotOption
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.ros.joint_trajectory import JointTrajectory
from robots.storage.files import write_atomically
from robots.storage.validation import between, name_choices

TRAJECTORY_SUFFIXES = (".yaml", ".yml", ".json")


@dataclass(frozen=True, kw_only=True)
class ExportMotionRequest(RobotOption):
    """Export the targets that servos receive, one row or point each control period: as CSV, or as
    a JointTrajectory of ROS, with velocities and accelerations, at rest at both ends."""

    motion: Positional[MotionName]
    trajectory: Annotated[Path | None, WRITTEN, arg(metavar="FILE.yaml|FILE.json")] = None
    """JointTrajectory to write."""
    csv: Annotated[Path | None, WRITTEN, arg(metavar="FILE.csv")] = None
    """CSV file to write: time [s] and every joint by its name [rad], after a header line."""
    goal: bool = False
    """Write the goal of the action FollowJointTrajectory instead of the message."""
    approach: Annotated[float, between(0.0, 60.0, "s"), arg(metavar="S")] = 2.0
    """Time in which the joints go from where they are to the motion's first targets [s]."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if (self.trajectory is None) == (self.csv is None):
            yield "expected either --trajectory or --csv, a file to write"
        if self.trajectory is not None and self.trajectory.suffix not in TRAJECTORY_SUFFIXES:
            expected = name_choices(TRAJECTORY_SUFFIXES)
            yield (f"--trajectory is {self.trajectory}, expected a name that ends with {expected}")


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


@command("motions export", json=True)
def export_motion(request: ExportMotionRequest, monitor: ProgressMonitor) -> ExportedMotion:
    """Write a motion as a JointTrajectory, or as CSV.

    Raises:
        BadInputError: if there is no such motion of the robot, or the file cannot be written.
    """
    monitor.begin("exporting")
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


@export_motion.show
def _print(found: ExportedMotion, _: ExportMotionRequest, console: Console) -> None:
    console.print(
        f"{found.name} of {found.robot}, from {found.start_class} to {found.end_class}: "
        f"{found.points} points, {found.duration_s:.2f} s; written to {found.file}",
        markup=False,
        soft_wrap=True,
    )
