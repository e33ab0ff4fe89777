"""The whole check of a robot."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.robot_check.arm_check import check_arms
from humanoid_getup.robot_check.finding import Finding
from humanoid_getup.robot_check.mirror_check import check_mirrors
from humanoid_getup.robot_check.squat_check import Squat, check_squats, list_squats
from humanoid_getup.robot_check.stance_check import check_stance
from humanoid_getup.simulation.world import World
from robots import Robot


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotCheck:
    """What was found of a robot."""

    findings: tuple[Finding, ...]
    squats: tuple[Squat, ...]
    """Balanced squats from high to deep."""

    @property
    def is_sound(self) -> bool:
        """Return whether there is no fault."""
        return all(finding.level != "fault" for finding in self.findings)


def check_robot(robot: Robot) -> RobotCheck:
    """Check stance, mirror pairs, squats and arms of a robot whose description loads.

    Raises:
        ValueError: if it has no two legs with a knee.
    """
    squats = list_squats(robot)
    lowest = min((squat.neck_share for squat in squats), default=1.0)
    findings = [
        *check_stance(World(robot)),
        *check_mirrors(robot),
        *check_squats(robot, squats),
        *check_arms(robot, lowest),
    ]
    return RobotCheck(findings=tuple(findings), squats=tuple(squats))
