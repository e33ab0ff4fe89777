"""Measurement and command of a control period."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DriverError
from robots import Robot
from robots.quaternion import Array

Integers = NDArray[np.int_]
MAX_NORM_ERROR = 0.1  # of an orientation's squared norm


class HardwareError(IntFlag):
    """Bits of `State.alert`, and of the items ``hardware_error_status`` and ``shutdown``."""

    VOLTAGE = 1
    OVERHEATING = 4
    ENCODER = 8
    SHOCK = 16
    OVERLOAD = 32

    def describe(self) -> str:
        """Name the errors (e-manual, Hardware Error Status)."""
        names = [str(bit.name).lower() for bit in HardwareError if bit & self]
        return (
            " and ".join(names).replace("shock", "electrical shock") or "an error of unknown kind"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """A measurement: only what a real robot can measure."""

    time: float
    """On the backend's own clock [s]."""
    joint_pos: Array
    """Joint angles from the encoders [rad], shape (n,), in the robot's joint order."""
    joint_vel: Array
    """Joint speeds [rad/s], shape (n,)."""
    joint_current: Array
    """Motor currents, positive in the actuator's positive direction [A], shape (n,)."""
    gyro: Array
    """Angular velocity in the IMU frame [rad/s], shape (3,); (0,) without an IMU."""
    orientation: Array
    """IMU frame to world, unit quaternion w x y z, shape (4,); its yaw drifts. (0,) without an
    IMU."""
    temperature: Array
    """Servo temperatures [°C], shape (n,)."""
    voltage: float
    """Supply at the servos [V]."""
    joint_age: Array = field(default_factory=lambda: np.zeros(0))
    """Age of each joint's angle, speed and current [s], shape (n,)."""
    imu_age: float = 0.0
    """Age of gyro and orientation [s]."""
    alert: Integers = field(default_factory=lambda: np.zeros(0, dtype=int))
    """`HardwareError` bits of each servo, shape (n,); 0 for none."""

    def __post_init__(self) -> None:
        n = len(self.joint_pos)
        if not len(self.joint_age):
            object.__setattr__(self, "joint_age", np.zeros(n))
        if not len(self.alert):
            object.__setattr__(self, "alert", np.zeros(n, dtype=int))

    @property
    def has_imu(self) -> bool:
        """Return whether it comes from a robot with an IMU."""
        return len(self.orientation) > 0

    @property
    def age(self) -> float:
        """Return the age of its oldest value [s]."""
        return max(float(self.joint_age.max()), self.imu_age)

    @property
    def is_valid(self) -> bool:
        """Return whether all numbers but the ages are finite, and the orientation is a rotation."""
        joints = self.joint_pos, self.joint_vel, self.joint_current, self.temperature
        others = self.gyro, self.orientation, (self.time, self.voltage)
        finite = bool(np.isfinite(np.concatenate((*joints, *others), dtype=float)).all())
        if not self.has_imu:
            return finite and not len(self.gyro)
        return finite and abs(float(self.orientation @ self.orientation) - 1.0) < MAX_NORM_ERROR


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """Targets and limits of all joints for one control period.

    Any value is accepted, NaN too: the guard checks it, not the constructor.
    """

    joint_pos: Array
    """Target angles [rad], shape (n,), in the robot's joint order."""
    gain_scale: Array
    """Share of each servo's position gain, 0 to 1, shape (n,)."""
    torque_limit: Array
    """Largest torque of each servo behind its gear [N·m], shape (n,); 0 releases it."""
    pwm_limit: Array
    """Largest share of the supply that drives each motor, 0 to 1, shape (n,)."""

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return len(self.joint_pos)

    @property
    def is_limp(self) -> bool:
        """Return whether every joint is released."""
        return not np.any(self.torque_limit)

    @staticmethod
    def limp(n: int) -> Command:
        """Release every joint."""
        return Command(
            joint_pos=np.zeros(n),
            gain_scale=np.ones(n),
            torque_limit=np.zeros(n),
            pwm_limit=np.ones(n),
        )

    @staticmethod
    def position(
        robot: Robot,
        joint_pos: Array,
        torque_limit: Array | float | None = None,
        pwm_limit: float = 1.0,
    ) -> Command:
        """Move joints to angles with full gain.

        Args:
            robot: Robot whose servos move.
            joint_pos: Target angles [rad], shape (n,).
            torque_limit: Largest torque [N·m], shape (n,) or one for all; ``None``, or more
                than the servos have, for their stall torque.
            pwm_limit: Largest share of the supply that drives the motors.
        """
        limit = robot.max_torque
        if torque_limit is not None:
            limit = np.minimum(limit, torque_limit)
        return Command(
            joint_pos=joint_pos,
            gain_scale=np.ones(robot.n),
            torque_limit=limit,
            pwm_limit=np.full(robot.n, pwm_limit),
        )


def find_command_problems(command: Command, joint_names: tuple[str, ...]) -> list[str]:
    """List everything wrong with a command: shapes, NaN or inf, negative torque limits."""
    n = len(joint_names)
    values = command.joint_pos, command.gain_scale, command.torque_limit, command.pwm_limit
    named = tuple(zip(("target", "gain share", "torque limit", "PWM limit"), values, strict=True))
    problems = [
        f"{name} has shape {np.shape(value)}, expected ({n},)"
        for name, value in named
        if np.shape(value) != (n,)
    ]
    # One NaN or inf makes the sum one, and a sum is fast.
    if problems or (
        math.isfinite(sum(float(value.sum()) for value in values))
        and command.torque_limit.min() >= 0.0
    ):
        return problems
    units = {"target": " rad", "torque limit": " N·m"}
    problems = [
        f"joint '{joint}': {name} is {number}{units.get(name, '')}"
        for name, value in named
        for joint, number in zip(joint_names, value, strict=True)
        if not np.isfinite(number)
    ]
    return problems + [
        f"joint '{joint}': torque limit is {limit} N·m, expected 0 or more"
        for joint, limit in zip(joint_names, command.torque_limit, strict=True)
        if limit < 0.0
    ]


def check_command(command: Command, joint_names: tuple[str, ...]) -> None:
    """Refuse an invalid command by an error that names everything that is wrong."""
    if problems := find_command_problems(command, joint_names):
        raise DriverError("command refused: " + "; ".join(problems))
