"""What a robot measures and what it is told, once a control period."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.errors import CommandError
from robots import Robot
from robots.quaternion import Array

Integers = NDArray[np.int_]


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """A measurement: only what a real robot can know."""

    time: float
    """When it was taken, on the backend's own clock [s]."""
    joint_pos: Array
    """Joint angles from the encoders [rad], shape (n,), in the robot's joint order."""
    joint_vel: Array
    """Joint speeds [rad/s], shape (n,)."""
    joint_current: Array
    """Motor currents, positive when they push in the joint's positive direction [A], shape (n,)."""
    gyro: Array
    """Angular velocity in the IMU frame [rad/s], shape (3,)."""
    orientation: Array
    """IMU frame to world, unit quaternion w x y z, shape (4,); its yaw is free and drifts."""
    temperature: Array
    """Servo temperatures [°C], shape (n,)."""
    voltage: float
    """Supply at the servos [V]."""
    joint_age: Array = field(default_factory=lambda: np.zeros(0))
    """How old each joint's angle, speed and current are [s], shape (n,); 0 is fresh."""
    imu_age: float = 0.0
    """How old gyro and orientation are [s]."""
    alert: Integers = field(default_factory=lambda: np.zeros(0, dtype=int))
    """Hardware error bits of each servo, shape (n,); 0 is well."""

    def __post_init__(self) -> None:
        n = len(self.joint_pos)
        if not len(self.joint_age):
            object.__setattr__(self, "joint_age", np.zeros(n))
        if not len(self.alert):
            object.__setattr__(self, "alert", np.zeros(n, dtype=int))

    @property
    def age(self) -> float:
        """Return how old the oldest of its angles, gyro and orientation are [s]."""
        return max(float(self.joint_age.max()), self.imu_age)

    @property
    def is_finite(self) -> bool:
        """Tell whether every number of the measurement is a number."""
        return bool(np.isfinite(self._numbers()).all())

    def _numbers(self) -> Array:
        joints = (self.joint_pos, self.joint_vel, self.joint_current, self.temperature)
        return np.concatenate(
            (*joints, self.gyro, self.orientation, (self.time, self.voltage)), dtype=float
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """What every joint shall do for one control period.

    A command may hold anything, NaN too: the guard judges it, not its constructor.
    """

    joint_pos: Array
    """Target angles [rad], shape (n,), in the robot's joint order."""
    gain_scale: Array
    """Share of each servo's position gain, 0 to 1, shape (n,)."""
    torque_limit: Array
    """Largest torque of each servo [N·m], shape (n,); 0 releases the joint."""
    pwm_limit: Array
    """Largest share of the supply that drives each motor, 0 to 1, shape (n,)."""

    @property
    def n(self) -> int:
        """Return the number of joints the command speaks to."""
        return len(self.joint_pos)

    @property
    def is_limp(self) -> bool:
        """Tell whether every joint is released."""
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
        """Send joints to angles with full gain.

        Args:
            robot: Robot whose servos move.
            joint_pos: Target angles [rad], shape (n,).
            torque_limit: Largest torque [N·m], shape (n,) or one for all, never above
                what the servos have; ``None`` for all that they have.
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


def check_command(command: Command, n: int) -> None:
    """Refuse a command that holds what no servo can be told.

    Raises:
        CommandError: naming all that is wrong.
    """
    values = command.joint_pos, command.gain_scale, command.torque_limit, command.pwm_limit
    if all(np.shape(value) == (n,) for value in values):
        # One number that is none spoils the sum, and a sum is quickly made.
        is_sound = math.isfinite(sum(float(value.sum()) for value in values))
        if is_sound and command.torque_limit.min() >= 0.0:
            return
    named = {
        "targets": command.joint_pos,
        "gain shares": command.gain_scale,
        "torque limits": command.torque_limit,
        "PWM limits": command.pwm_limit,
    }
    faults = [
        f"{name}: {values}, allowed {n} finite numbers"
        for name, values in named.items()
        if np.shape(values) != (n,) or not np.isfinite(values).all()
    ]
    if not faults and (command.torque_limit < 0.0).any():
        faults = [f"torque limits: {command.torque_limit}, allowed 0 or more"]
    if faults:
        raise CommandError(faults)
