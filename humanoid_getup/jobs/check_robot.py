"""Checks a robot: its description and its abilities."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.robots import CheckRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.robot_check.check import RobotCheck
from humanoid_getup.robot_check.check import check_robot as check
from humanoid_getup.robot_check.finding import CheckFinding
from robots import Robot, RobotError, load_robot


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckedRobot:
    """A robot, and the findings of its check."""

    robot: Robot
    check: RobotCheck

    @property
    def findings(self) -> tuple[CheckFinding, ...]:
        """Return the findings, by part of the check."""
        return self.check.findings

    @property
    def is_sound(self) -> bool:
        """Return whether there is no fault."""
        return self.check.is_sound


def check_robot(
    request: CheckRequest, report: Report | None = None, cancel: Cancel | None = None
) -> CheckedRobot:
    """Check whether a robot's description is sound and its body able to get up.

    Raises:
        BadInputError: if the description does not load.
        CancelledError: if ``cancel`` ended it before.
    """
    CheckRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    try:
        robot = load_robot(request.robot)
        found = check(robot, lambda part: monitor.begin(f"checking {part}"))
    except ValueError as error:
        problems = error.problems if isinstance(error, RobotError) else [str(error)]
        raise BadInputError(*problems) from error
    return CheckedRobot(robot=robot, check=found)
