"""Figures of a sample of a live feed: the program, the torso, the joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.live_feed.messages import LiveSample
from drivers.state import HardwareError
from humanoid_getup.experiments.starts.falls import classify
from robots import Joint, Robot, quaternion
from robots.quaternion import Array

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
    def of(cls, sample: LiveSample, imu_in_torso: Array | None) -> TorsoFigures | None:
        """Compute the attitude of a sample; None without an IMU.

        ``imu_in_torso`` is the orientation of the IMU in the torso, (4,).
        """
        if imu_in_torso is None or not sample.orientation:
            return None
        mounting = quaternion.inverse(imu_in_torso)
        orientation = quaternion.multiply(np.array(sample.orientation), mounting)
        x, y, z = np.clip(quaternion.gravity_in_body(orientation), -1.0, 1.0).tolist()
        side = classify(orientation)
        rates = quaternion.rotate(imu_in_torso, np.array(sample.gyro)).tolist()
        return cls(
            lies=SIDES[side] if side else UPRIGHT if z < 0.0 else HEAD_DOWN,
            pitch_rad=math.asin(x),
            roll_rad=math.asin(-y),
            rates_rad_s=(rates[0], rates[1], rates[2]),
            age_s=sample.imu_age,
        )


@dataclass(frozen=True, kw_only=True)
class LiveJoint:
    """What a joint measures."""

    angle_rad: float
    target_rad: float | None
    """None for a joint without torque."""
    current_a: float
    temperature_c: float
    remarks: tuple[str, ...]
    """What a person should know about it."""


def list_joints(sample: LiveSample, robot: Robot) -> dict[str, LiveJoint]:
    """List the figures of a sample's joints, by name."""
    columns = zip(
        robot.joints,
        sample.joint_pos,
        sample.target,
        sample.joint_current,
        sample.temperature,
        sample.joint_age,
        sample.alert,
        strict=True,
    )
    return {
        joint.name: LiveJoint(
            angle_rad=angle,
            target_rad=None if sample.is_limp else target,
            current_a=current,
            temperature_c=heat,
            remarks=tuple(_list_remarks(joint, angle, age, alert)),
        )
        for joint, angle, target, current, heat, age, alert in columns
    }


def describe_program(sample: LiveSample) -> str:
    """Describe what the program does, and the robot as a whole."""
    torque = "torque off" if sample.is_limp else "torque on"
    return (
        f"{sample.phase or 'waiting'}, {sample.time:.2f} s, {torque}, {sample.voltage:.1f} V, "
        f"{sample.clips} commands cut, {1000.0 * sample.busy:.1f} ms busy"
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
