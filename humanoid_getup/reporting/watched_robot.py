"""What was seen of a limp robot: its newest cycle, and the angles through which it was turned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers import Cycle, State
from drivers.state import HardwareError
from humanoid_getup.experiments.falls import classify
from humanoid_getup.simulation.world import World
from robots import Joint, quaternion
from robots.kinematics import find_directions, imu_in_torso
from robots.quaternion import Array

# A damaged reply now and then harms nothing.
FEW_MISSED, MISSED_SHARE = 2, 0.01  # reads, and share of all reads
OUTSIDE_RANGE = 0.1  # rad that a joint may be beyond its range without a remark
OLD = 0.25  # s; a value that is older is no longer shown as one of now
UPRIGHT, HEAD_DOWN = "upright", "head down"
SIDES = {
    "supine": "on its back",
    "prone": "on its belly",
    "left": "on its left side",
    "right": "on its right side",
}


@dataclass(frozen=True, kw_only=True)
class TorsoFigures:
    """Attitude of the torso, as its IMU measures it; heading is not measured."""

    lies: str
    """Which way up it is: upright, head down, or on one of four sides."""
    pitch_rad: float
    """Angle of its x axis below the horizontal: it leans forward."""
    roll_rad: float
    """Angle of its y axis above the horizontal: it leans to its right."""
    rates_rad_s: tuple[float, float, float]
    """Angular velocity about its x, y and z axis."""
    age_s: float

    @classmethod
    def of(cls, state: State, imu_in_torso: Array | None) -> TorsoFigures | None:
        """Compute the attitude of a state; None without an IMU.

        ``imu_in_torso`` is the orientation of the IMU in the torso, (4,).
        """
        if imu_in_torso is None or not state.has_imu:
            return None
        mounting = quaternion.inverse(imu_in_torso)
        orientation = quaternion.multiply(state.orientation, mounting)
        x, y, z = np.clip(quaternion.gravity_in_body(orientation), -1.0, 1.0).tolist()
        side = classify(orientation)
        rates = quaternion.rotate(imu_in_torso, state.gyro).tolist()
        return cls(
            lies=SIDES[side] if side else UPRIGHT if z < 0.0 else HEAD_DOWN,
            pitch_rad=math.asin(x),
            roll_rad=math.asin(-y),
            rates_rad_s=(rates[0], rates[1], rates[2]),
            age_s=state.imu_age,
        )


@dataclass(frozen=True, kw_only=True)
class WatchedJoint:
    """What a joint measures, and the angles that were seen."""

    angle_rad: float
    target_rad: float | None
    """None for a joint without torque."""
    current_a: float
    temperature_c: float
    remarks: tuple[str, ...]
    """What a person should know about it."""
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
    """Sees each cycle of a limp robot; any thread may ask for its figures."""

    def __init__(self, world: World) -> None:
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

    def look(self) -> WatchFigures | None:
        """Return what is known now; None before the first cycle."""
        if (cycle := self._newest) is None:
            return None
        state, joints = cycle.state, self._list_joints(cycle)
        return WatchFigures(
            time_s=float(state.time),
            reads=self._reads,
            voltage_v=float(state.voltage),
            torque_on=not cycle.sent.is_limp,
            torso=TorsoFigures.of(state, self._mounting),
            joints=joints,
            findings=tuple(self._list_findings(joints)),
        )

    def _list_joints(self, cycle: Cycle) -> dict[str, WatchedJoint]:
        state, is_limp = cycle.state, cycle.sent.is_limp
        columns = (
            state.joint_pos,
            cycle.sent.joint_pos,
            state.joint_current,
            state.temperature,
            state.joint_age,
            state.alert,
            state.joint_vel,
            self._missed,
            self._lowest,
            self._highest,
        )
        rows = zip(self._robot.joints, *(column.tolist() for column in columns), strict=True)
        return {
            joint.name: WatchedJoint(
                angle_rad=angle,
                target_rad=None if is_limp else target,
                current_a=current,
                temperature_c=heat,
                remarks=tuple(_list_remarks(joint, angle, age, alert)),
                speed_rad_s=speed,
                missed=missed,
                lowest_rad=low,
                highest_rad=high,
                lower_rad=joint.lower,
                upper_rad=joint.upper,
                positive=self._directions[joint.name].way,
            )
            for joint, angle, target, current, heat, age, alert, speed, missed, low, high in rows
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


def describe_torso(torso: TorsoFigures | None) -> str:
    """Describe the attitude of the torso in a line."""
    if torso is None:
        return "no IMU: attitude unknown"
    pitch, roll = format_degrees(torso.pitch_rad, 1), format_degrees(torso.roll_rad, 1)
    rates = zip("xyz", map(format_degrees, torso.rates_rad_s), strict=True)
    turning = ", ".join(f"{axis} {rate}" for axis, rate in rates)
    old = f"; silent for {torso.age_s:.1f} s" if torso.age_s > OLD else ""
    return (
        f"torso {torso.lies}: pitch {pitch}° (+ forward), roll {roll}° (+ to its right); "
        f"gyro {turning} °/s{old}"
    )


def format_degrees(angle: float, decimals: int = 0) -> str:
    """Write an angle [rad] or a rate in degrees with its sign; no -0."""
    return f"{round(math.degrees(angle), decimals) + 0.0:+.{decimals}f}"


def measure_excess(joint: Joint, angles: Sequence[float]) -> float:
    """Measure how far the farthest of some angles is beyond a joint's range [rad]; 0 for none."""
    farthest = max((max(joint.lower - angle, angle - joint.upper) for angle in angles), default=0.0)
    return farthest if farthest > OUTSIDE_RANGE else 0.0


def _list_remarks(joint: Joint, angle: float, age: float, alert: int) -> list[str]:
    remarks = []
    if age > OLD:
        remarks.append(f"silent for {age:.1f} s")
    if alert:
        remarks.append(HardwareError(alert).describe())
    if excess := measure_excess(joint, [angle]):
        remarks.append(f"{math.degrees(excess):.0f}° beyond its range")
    return remarks
