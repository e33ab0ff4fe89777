"""Connects servos, of a robot or of a bench, to be moved through the guard."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.bus import ANSWER_MARGIN
from drivers.dynamixel.clock import Clock
from drivers.errors import SetupError
from drivers.safety_guard import SafetyGuard
from drivers.safety_limits import GuardLimits
from robots import Robot
from robots.bench import ServoBench
from robots.quaternion import Array
from robots.storage.validation import name_unknown_joints
from robots.torque_limit import TorqueLimit

MARGIN_SHARE = 0.25  # of a bench's period, for which a reply may be late
SHARE_OF_STALL = 0.5  # torque with which servos are moved by hand where no limit is given


@dataclass(frozen=True)
class MovedServos:
    """Servos that may be moved, and the torque that they may use."""

    robot: Robot
    """Robot or bench."""
    ports: Mapping[str, str]
    """Device of each of its ports."""
    chosen: tuple[int, ...]
    """Numbers of the joints to move."""
    torque_limit: Array
    """Of each servo [N·m], (n,)."""

    def make_guard(self) -> SafetyGuard:
        """Make a guard of the servos, not connected yet.

        Raises:
            SetupError: if the robot's bus or IMU is not described as its ports need.
        """
        return SafetyGuard(self.make_backend(), GuardLimits.of(self.robot))

    def make_backend(self, clock: Clock | None = None) -> DynamixelBackend:
        """Make the backend of the servos, for a guard; no clock for wall time.

        Raises:
            SetupError: if the robot's bus or IMU is not described as its ports need.
        """
        without_imu = self.robot.imu_kind is None
        options = None
        is_real = clock is None or clock.is_real
        if is_real and isinstance(self.robot, ServoBench):  # beside any other work
            margin = max(ANSWER_MARGIN, MARGIN_SHARE * self.robot.control_period)
            options = DriverOptions(answer_margin=margin)
        return DynamixelBackend(
            self.robot, self.ports, clock=clock, without_imu=without_imu, options=options
        )


def choose_servos(
    robot: Robot,
    ports: Mapping[str, str],
    names: Sequence[str] = (),
    torque_limit: float | None = None,
) -> MovedServos:
    """Choose the joints of a robot that are moved, by default all, and their torque [N·m].

    Raises:
        SetupError: if it has no such joint, or the limit is more than its servos have.
    """
    chosen = find_joints(robot, names)
    if torque_limit is None:
        return MovedServos(robot, ports, chosen, SHARE_OF_STALL * robot.max_torque)
    try:
        TorqueLimit(torque_limit).on(robot)
    except ValueError as error:
        raise SetupError(str(error)) from error
    return MovedServos(robot, ports, chosen, np.minimum(robot.max_torque, torque_limit))


def find_joints(robot: Robot, names: Sequence[str]) -> tuple[int, ...]:
    """Find joints by name, all without any; return their numbers, in the robot's order.

    Raises:
        SetupError: if the robot has no such joint.
    """
    unknown = [name for name in names if name not in robot.joint_names]
    if problems := name_unknown_joints(unknown, robot.joint_names):
        raise SetupError("; ".join(problems))
    return tuple(i for i, name in enumerate(robot.joint_names) if not names or name in names)


def check_target(robot: Robot, joint: int, angle: float) -> None:
    """Check that a target [rad] is in the range of a joint, given by its number.

    Raises:
        SetupError: if it is not; nothing has moved.
    """
    lower, upper = robot.lower[joint], robot.upper[joint]
    if not lower <= angle <= upper:
        degrees = np.degrees([angle, lower, upper])
        raise SetupError(
            f"joint '{robot.joint_names[joint]}': target is {degrees[0]:+.1f}°, expected "
            f"{degrees[1]:+.1f}° to {degrees[2]:+.1f}°"
        )
