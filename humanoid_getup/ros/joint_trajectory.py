"""Motions as ROS's `trajectory_msgs/msg/JointTrajectory`.

`joint_trajectory_controller` interpolates quintic splines between points that have positions,
velocities and accelerations, cubic ones without accelerations, and straight lines without
velocities. Here all points have all three, one point each control period: there the controller
sends what our player sends, and between them it stays close.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np

from drivers.flight_log.foxglove import SECOND
from humanoid_getup.motions.motion import Motion
from robots import Robot
from robots.quaternion import Array

POSITION_DIGITS, VELOCITY_DIGITS, ACCELERATION_DIGITS = 6, 5, 4
ROUNDING = 1e-9  # of a number of control periods


@dataclass(frozen=True, kw_only=True)
class JointTrajectory:
    """Points that joints go through, at rest at both ends."""

    joint_names: tuple[str, ...]
    time: Array
    """Time of each point from the start [s], shape (T,)."""
    position: Array
    """Targets [rad], shape (T, n)."""
    velocity: Array
    """[rad/s], shape (T, n)"""
    acceleration: Array
    """[rad/s²], shape (T, n)"""

    @classmethod
    def of(cls, motion: Motion, robot: Robot, approach: float) -> JointTrajectory:
        """Sample the servo targets of a motion each control period.

        The derivatives are central differences; at both ends the joints rest. In the time of the
        first point, ``approach`` [s], joints go to it from where they are.
        """
        period = robot.control_period
        count = 1 + math.ceil(motion.duration / period - ROUNDING)
        time = np.arange(count) * period
        target = motion.sample(motion.time[0] + time)
        before, after = np.vstack([target[:1], target[:-1]]), np.vstack([target[1:], target[-1:]])
        velocity = (after - before) / (2.0 * period)
        acceleration = (after - 2.0 * target + before) / period**2
        velocity[[0, -1]] = acceleration[[0, -1]] = 0.0
        return cls(
            joint_names=robot.joint_names,
            time=np.asarray(approach + time, dtype=float),
            position=target,
            velocity=velocity,
            acceleration=acceleration,
        )

    def to_yaml(self, *, goal: bool = False) -> str:
        """Write the message, or the goal of `FollowJointTrajectory` with it, as YAML."""
        names = ", ".join(msgspec.json.encode(name).decode() for name in self.joint_names)
        lines = [f"joint_names: [{names}]", "points:", *map(_write_point, self._list_points())]
        if goal:
            lines = ["trajectory:", *(f"  {line}" for line in lines)]
        return "\n".join(lines) + "\n"

    def to_json(self, *, goal: bool = False) -> str:
        """Write the same as JSON."""
        points = [
            {"time_from_start": stamp} | {key: list(map(float, row)) for key, row in rows.items()}
            for stamp, rows in self._list_points()
        ]
        message = {"joint_names": self.joint_names, "points": points}
        return msgspec.json.encode({"trajectory": message} if goal else message).decode() + "\n"

    def _list_points(self) -> Iterator[tuple[dict[str, int], dict[str, list[str]]]]:
        """Yield time and values of each point; values as texts that any YAML reads as numbers."""
        columns = {
            "positions": _format(self.position, POSITION_DIGITS),
            "velocities": _format(self.velocity, VELOCITY_DIGITS),
            "accelerations": _format(self.acceleration, ACCELERATION_DIGITS),
        }
        for k, time in enumerate(self.time):
            yield make_stamp(round(time * SECOND)), {key: c[k] for key, c in columns.items()}


def _format(values: Array, digits: int) -> list[list[str]]:
    """Write numbers without exponent: YAML 1.1 takes 1e-05 for a text."""
    rounded = np.round(values, digits) + 0.0  # no -0
    return [[f"{value:.{digits}f}" for value in row] for row in rounded.tolist()]


def _write_point(point: tuple[dict[str, int], dict[str, list[str]]]) -> str:
    stamp, rows = point
    time = f"time_from_start: {{sec: {stamp['sec']}, nanosec: {stamp['nanosec']}}}"
    values = (f"{key}: [{', '.join(row)}]" for key, row in rows.items())
    return f"- {{{', '.join((time, *values))}}}"


def make_stamp(time: int) -> dict[str, int]:
    """Write a time [ns] as ROS does."""
    return dict(zip(("sec", "nanosec"), divmod(time, SECOND), strict=True))
