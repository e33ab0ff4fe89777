"""What was seen of a limp robot: its newest cycle, and the angles through which it was turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers import Cycle
from drivers.live_feed.messages import LiveSample
from humanoid_getup.reporting.live_figures import (
    LiveJoint,
    TorsoFigures,
    format_degrees,
    list_joints,
    measure_excess,
)
from humanoid_getup.simulation.world import World
from robots.joint_directions import find_directions
from robots.kinematics import imu_in_torso

# A damaged reply now and then harms nothing.
FEW_MISSED, MISSED_SHARE = 2, 0.01  # reads, and share of all reads


@dataclass(frozen=True, kw_only=True)
class WatchedJoint(LiveJoint):
    """A joint, and the angles that were seen."""

    speed_rad_s: float
    missed: int
    """Number of reads that brought nothing new."""
    lowest_rad: float
    highest_rad: float
    lower_rad: float
    """Lower end of its range."""
    upper_rad: float
    positive: str
    """Which way its limb moves as its angle grows, when the robot stands."""


@dataclass(frozen=True, kw_only=True)
class WatchFigures:
    """A limp robot now, and what was seen of it."""

    time_s: float
    reads: int
    voltage_v: float
    torque_on: bool
    torso: TorsoFigures | None
    """None without an IMU."""
    joints: dict[str, WatchedJoint]
    findings: tuple[str, ...]
    """What contradicts the description of the robot."""


class WatchedRobot:
    """An onlooker of a limp robot, which any thread may ask for its figures."""

    def __init__(self, world: World) -> None:
        """Prepare; nothing was seen yet."""
        self._robot = robot = world.robot
        self._mounting = imu_in_torso(robot, world.model) if robot.imu_site else None
        self._directions = find_directions(robot)
        self._newest: Cycle | None = None
        self._lowest, self._highest = np.full(robot.n, np.inf), np.full(robot.n, -np.inf)
        self._reads, self._missed = 0, np.zeros(robot.n, dtype=int)

    def show(self, cycle: Cycle) -> None:
        """See a cycle."""
        self._lowest = np.minimum(self._lowest, cycle.state.joint_pos)
        self._highest = np.maximum(self._highest, cycle.state.joint_pos)
        self._reads += 1
        self._missed = self._missed + (cycle.state.joint_age > 0.0)
        self._newest = cycle

    def note(self, phase: str) -> None:
        """Ignore a phase: the robot is watched and nothing else."""

    def look(self) -> WatchFigures | None:
        """Return what is known now; None before the first cycle."""
        if self._newest is None:
            return None
        sample = LiveSample.of(self._newest, "")
        joints = self._list_joints(self._newest, sample)
        return WatchFigures(
            time_s=sample.time,
            reads=self._reads,
            voltage_v=sample.voltage,
            torque_on=not sample.is_limp,
            torso=TorsoFigures.of(sample, self._mounting),
            joints=joints,
            findings=tuple(self._list_findings(joints)),
        )

    def _list_joints(self, cycle: Cycle, sample: LiveSample) -> dict[str, WatchedJoint]:
        speeds = cycle.state.joint_vel.tolist()
        spans = self._lowest.tolist(), self._highest.tolist()
        seen = zip(speeds, self._missed.tolist(), *spans, strict=True)
        named = list_joints(sample, self._robot).items()
        rows = zip(self._robot.joints, named, seen, strict=True)
        return {
            name: WatchedJoint(
                **vars(measured),
                speed_rad_s=speed,
                missed=missed,
                lowest_rad=lowest,
                highest_rad=highest,
                lower_rad=joint.lower,
                upper_rad=joint.upper,
                positive=self._directions[name].way,
            )
            for joint, (name, measured), (speed, missed, lowest, highest) in rows
        }

    def _list_findings(self, joints: dict[str, WatchedJoint]) -> list[str]:
        findings = []
        for joint in self._robot.joints:
            seen = joints[joint.name]
            if measure_excess(joint, [seen.lowest_rad, seen.highest_rad]):
                findings.append(f"joint '{joint.name}' {_contrast(seen)}")
            if seen.missed > max(FEW_MISSED, MISSED_SHARE * self._reads):
                findings.append(
                    f"joint '{joint.name}' did not answer {seen.missed} of {self._reads} reads: "
                    "check its cable and plug (getup doctor)"
                )
        return findings


@dataclass(frozen=True, kw_only=True)
class WatchReport:
    """How a robot was watched."""

    robot: str
    backend: str
    reason: str
    """Why it ended."""
    by_fault: bool
    watched_s: float
    cycles: int
    period_s: float
    last: WatchFigures | None
    """What was seen until the end; None if that was nothing."""


def _contrast(joint: WatchedJoint) -> str:
    lowest, highest, lower, upper = (
        format_degrees(angle)
        for angle in (joint.lowest_rad, joint.highest_rad, joint.lower_rad, joint.upper_rad)
    )
    return (
        f"was seen from {lowest} to {highest}°, expected within its range from {lower} to "
        f"{upper}°: its zero or its sign is wrong (getup calibrate), or its range in robot.toml"
    )
