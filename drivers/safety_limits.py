"""Limits of the safety guard, and counts of its cuts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robots import Robot
from robots.quaternion import Array
from robots.servo import VOLTAGE_ROUNDING

# A servo switches itself off at its Temperature Limit (e-manual), 80 °C for an XM430. The guard
# acts earlier, while the robot can still be lowered by hand without burns.
HOT_MARGIN = 5.0  # °C
# From here on torque is derated, so that a servo cools before it switches itself off.
DERATE_MARGIN = 15.0  # °C
DERATED_SHARE = 0.4  # of the torque limit that is left at the highest temperature, lowest supply
SHUTDOWN_SHARE = 0.95  # of the least supply: an X servo's own least, 9.5 V, beside 10 V
LIMP_SILENCE = 3.0  # s of silence of servos or IMU: harmless without torque


def find_max_temperature(robot: Robot) -> Array:
    """Find the temperatures above which the guard releases a robot's servos [°C], (n,)."""
    return np.array([joint.servo.model.temperature_limit - HOT_MARGIN for joint in robot.joints])


def find_derate_temperature(robot: Robot) -> Array:
    """Find the temperatures from which on a robot's servos get less torque [°C], (n,)."""
    return np.array([joint.servo.model.temperature_limit - DERATE_MARGIN for joint in robot.joints])


@dataclass(frozen=True, kw_only=True)
class GuardLimits:
    """The limits of a guard."""

    lower: Array
    """Lowest target angles [rad], shape (n,)."""
    upper: Array
    """Highest target angles [rad], shape (n,)."""
    max_velocity: Array
    """Fastest change of targets [rad/s], shape (n,)."""
    torque_limit: Array
    """Highest torque limit of each servo, behind its gear [N·m], shape (n,)."""
    max_temperature: Array | float
    """Highest temperature of each servo [°C], shape (n,), or of all; infinity for any."""
    derate_temperature: Array | float
    """Temperature above which each servo's torque limit is derated [°C], shape (n,), or of all."""
    min_voltage: float = 0.0
    """Supply below which the torque limits are derated [V]."""
    shutdown_voltage: float = 0.0
    """The servos' own least supply [V]: they report what is below."""
    longest_dip: float = 2.0  # four turns of the background read of 20 servos
    """Time below ``min_voltage`` that is a fault [s]."""
    longest_report: float = 0.1
    """Time below ``shutdown_voltage``, or while servos report their supply, that is a fault [s]."""
    max_pause: float = 0.1  # the servos' watchdog: from there on they stop by themselves
    """Time between two measurements under torque that is a fault [s]."""
    stale_writes: int = 5  # 40 ms at the OP3's cycle: more than a retried read, less than a fall
    """Number of commands upon one measurement that is a fault."""
    hold_cycles: int = 3  # up to two lost or damaged measurements are bridged
    """Age of a joint's values, in periods, from which the targets are held."""
    limp_cycles: int = 12  # without them for a tenth of a second a rise can no longer be saved
    """Age of a joint's values, in periods, that is a fault."""
    max_imu_age: float = 0.3  # longer, and a fall would not be noticed
    """Highest age of gyro and orientation [s]."""

    def __post_init__(self) -> None:
        if not np.all(self.lower <= self.upper):
            raise ValueError("guard limits: lower must not exceed upper")
        for name in ("max_velocity", "torque_limit"):
            values = getattr(self, name)
            if not np.all(np.isfinite(values) & (values >= 0.0)):
                raise ValueError(f"guard limits: {name} is {values}, expected 0 or more")

    def check_range(self, robot: Robot) -> None:
        """Check that the range of each target lies within that of its joint."""
        outside = ~((self.lower >= robot.lower) & (self.upper <= robot.upper))
        if problems := [
            f"joint '{robot.joint_names[i]}': {self.lower[i]:+.3f} to {self.upper[i]:+.3f} rad, "
            f"expected a range within {robot.lower[i]:+.3f} to {robot.upper[i]:+.3f} rad"
            for i in np.flatnonzero(outside)
        ]:
            raise ValueError(f"guard limits: {'; '.join(problems)}")

    @staticmethod
    def of(robot: Robot, torque_limit: float | None = None) -> GuardLimits:
        """Build the limits of a robot's joints and servos.

        ``torque_limit`` holds at every servo [N·m] whose own is not lower.
        """
        if torque_limit is not None and not 0.0 <= torque_limit < np.inf:
            raise ValueError(f"torque limit is {torque_limit} N·m, expected a finite number >= 0")
        cap = np.inf if torque_limit is None else torque_limit
        return GuardLimits(
            lower=robot.lower,
            upper=robot.upper,
            max_velocity=robot.max_velocity,
            torque_limit=np.minimum(robot.max_torque, robot.transmission.torque_at_actuator(cap)),
            max_temperature=find_max_temperature(robot),
            derate_temperature=find_derate_temperature(robot),
            min_voltage=robot.supply_range[0],
            shutdown_voltage=SHUTDOWN_SHARE * robot.supply_range[0],
        )

    @staticmethod
    def of_limp(robot: Robot) -> GuardLimits:
        """Build the limits of a robot that stays limp, which may be silent for longer."""
        cycles = round(LIMP_SILENCE / robot.control_period)
        limits = GuardLimits.of(robot)
        return replace(limits, limp_cycles=cycles, stale_writes=cycles, max_imu_age=LIMP_SILENCE)

    def derate(self, temperature: Array, voltage: float = np.inf) -> Array:
        """Compute the torque limits [N·m] at servo temperatures [°C], (n,), and a supply [V].

        Linear from the full limit at ``derate_temperature`` to a share at ``max_temperature``, and
        from that at ``min_voltage`` to the same share at ``shutdown_voltage``.
        """
        span = np.asarray(self.max_temperature - self.derate_temperature)
        has_span = (span > 0.0) & (span < np.inf)
        excess = np.where(has_span, temperature - self.derate_temperature, 0.0)
        heat = np.minimum(np.maximum(excess / np.where(has_span, span, 1.0), 0.0), 1.0)
        room = max(self.min_voltage - self.shutdown_voltage, 1e-9)
        lack = self.min_voltage - VOLTAGE_ROUNDING - voltage
        dip = min(max(lack / room, 0.0), 1.0)
        lost = 1.0 - DERATED_SHARE
        return self.torque_limit * (1.0 - lost * heat) * (1.0 - lost * dip)


@dataclass(frozen=True, eq=False)
class ClipCounts:
    """How often each joint's command was cut, by kind."""

    position: np.ndarray
    """Targets beyond the joint's range, shape (n,)."""
    velocity: np.ndarray
    """Targets too far from the last one, shape (n,)."""
    torque: np.ndarray
    """Torque limits above the guard's, shape (n,)."""
    gain: np.ndarray
    """Gain shares outside 0 to 1, shape (n,)."""
    pwm: np.ndarray
    """PWM limits outside 0 to 1, shape (n,)."""

    @property
    def total(self) -> int:
        """Return the number of cuts of all kinds and joints."""
        return int(sum(np.sum(kind) for kind in vars(self).values()))

    def describe(self, robot: Robot) -> list[str]:
        """Describe the cuts of each joint and kind, one line each."""
        return [
            f"joint '{joint}': {kind} cut {count} times"
            for kind, counts in vars(self).items()
            for joint, count in zip(robot.joint_names, counts, strict=True)
            if count
        ]
