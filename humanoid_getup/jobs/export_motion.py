"""Exports a motion for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
    """From the start of the approach to the last point."""
    start_class: str
    end_class: str


def export_motion(request: ExportMotionRequest) -> ExportedMotion:
    """Write a motion as a JointTrajectory.

    Raises:
        BadInputError: if there is no such motion of the robot, or the file cannot be written.
    """
    ExportMotionRequest.accept(request)
    robot = load_robot(request)
    motion = find_motion(robot, request.motion)
    trajectory = JointTrajectory.of(motion, robot, request.approach)
    is_json = request.trajectory.suffix == ".json"
    write = trajectory.to_json if is_json else trajectory.to_yaml
    try:
        request.trajectory.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(request.trajectory, write(goal=request.goal))
    except OSError as error:
        raise BadInputError(f"output file {request.trajectory}: {error.strerror}") from error
    return ExportedMotion(
        name=motion.name,
        robot=robot.name,
        file=request.trajectory,
        points=len(trajectory.time),
        duration_s=float(trajectory.time[-1]),
        start_class=motion.start_class,
        end_class=motion.end_class,
    )
