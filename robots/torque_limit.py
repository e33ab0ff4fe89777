"""The limit on the torque of a robot's servos, and how simulated ones apply it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from robots.arguments import expect
from robots.quaternion import Array
from robots.robot import Robot
from robots.servo import CURRENT, LIMIT_MODES, PWM, PWM_FULL_SCALE, LimitMode, round_pwm


@dataclass(frozen=True)
class TorqueLimit:
    """A limit on the torque of every servo."""

    value: float | None = None
    """[N·m]; None for no limit below the servos' stall torque."""
    by: LimitMode | None = None
    """``"current"``: the motor's current is limited, in current-based position mode. ``"pwm"``:
    its voltage is, in position mode, so that less torque is left the faster the servo turns.
    ``"ideal"``: the torque itself, which no servo can; for comparison only. None: as the robot's
    description says."""

    def __post_init__(self) -> None:
        is_number = isinstance(self.value, int | float) and not isinstance(self.value, bool)
        if self.value is not None and not is_number:
            raise ValueError(f"torque limit is {self.value!r}, expected a number in N·m")
        if self.by not in (None, *get_args(LimitMode)):
            expected = ", ".join(map(repr, get_args(LimitMode)))
            raise ValueError(f"torque limit is by {self.by!r}, expected one of {expected}")
        if self.value is not None and not 0.0 < self.value < math.inf:
            raise ValueError(
                f"torque limit is {self.value:g} N·m, expected a finite number above 0 N·m"
            )

    def on(self, robot: Robot) -> TorqueLimit:
        """Return this limit with the mode in which a robot's servos apply it."""
        by = robot.limit_by if self.by is None else self.by
        check_mode(robot, by)
        full = float(robot.max_torque.max())
        if self.value is not None and self.value > full:
            raise ValueError(
                f"torque limit is {self.value:g} N·m, expected at most {full:g} N·m, the stall "
                f"torque of the servos of robot '{robot.name}'"
            )
        count = float((robot.current_step * robot.torque_per_ampere).max())
        # The smallest limits that leave every servo some torque.
        least = {"current": count, "pwm": full / PWM_FULL_SCALE}.get(by, 0.0)
        if self.value is not None and self.value < least:
            raise ValueError(
                f"torque limit is {self.value:g} N·m, expected at least {least:.2g} N·m, one "
                f"count of the servos of robot '{robot.name}' by {by}"
            )
        return replace(self, by=by)

    @property
    def mode(self) -> LimitMode:
        """Return the mode of a limit on a robot, one that :meth:`on` returned."""
        if self.by is None:
            raise ValueError("torque limit has no mode yet, expected TorqueLimit(...).on(robot)")
        return self.by


FULL_TORQUE = TorqueLimit()
"""No limit: all the torque that the servos have."""


def check_torque_limit(limit: TorqueLimit, robot: Robot) -> TorqueLimit:
    """Return a torque limit with the mode in which a robot's servos apply it."""
    expect("torque_limit", limit, TorqueLimit, "a TorqueLimit, e.g. TorqueLimit(2.5)")
    return limit.on(robot)


def check_mode(robot: Robot, by: LimitMode) -> None:
    """Refuse a way to limit torque that a servo does not have; the error names the servo."""
    for joint in robot.joints:
        model = joint.servo.model
        if by == "current" and not model.has_current_mode:
            raise ValueError(
                f"torque limit is by 'current', expected 'pwm': the {model.name} of joint "
                f"'{joint.name}' has no current sensor"
            )


RESISTANCE, MOTOR_CONSTANT, KP, KD, VMAX = 0, 1, 4, 6, 7
"""Columns of a ``dcmotor``'s gainprm."""
GAIN_COLUMNS = 10

LimitModes = LimitMode | NDArray[np.int_]
"""A mode, or the places of modes in ``LIMIT_MODES``."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """Gains and limits of servos in a position mode; the arrays have shape (..., n)."""

    torque: Array
    """Largest torque of each motor [N·m]; 0: torque is off."""
    pwm: Array
    """Largest share of the supply on each motor."""
    gain_scale: Array | float = 1.0
    """Share of the position gain."""
    by_current: NDArray[np.bool_] | bool = False
    """Whether the position loop commands a current, as in current-based position mode, and not a
    share of the supply."""
    follows_supply: NDArray[np.bool_] | bool = False
    """Whether the largest torque is the motor's at the nominal supply, and not a limit."""
    damping: Array | None = None
    """Damping of the loop that commands a current [N·m·s/rad]; ``None`` for the robot's own."""

    @staticmethod
    def released(n: int) -> Drive:
        """Leave all motors without torque."""
        return Drive(torque=np.zeros(n), pwm=np.ones(n))

    def equals(self, other: Drive) -> bool:
        """Return whether all values are the same."""
        pairs = ((value, vars(other)[name]) for name, value in vars(self).items())
        return other is self or all(np.array_equal(value, same) for value, same in pairs)

    def limits(self, robot: Robot, voltage: Array | float) -> Array:
        """Compute the largest torques of a robot's servos at a supply (...) [V], (..., n) [N·m].

        The stall torque of position mode follows a supply above the nominal one; below it, the
        voltage alone limits a motor that drives, and one that brakes has its nominal torque.
        """
        share = np.asarray(voltage, dtype=float)[..., None] / robot.nominal_voltage
        of_supply = np.where(self.follows_supply, np.maximum(share, 1.0), 1.0)
        return self.torque * of_supply * robot.individual.strength

    def gains(self, robot: Robot, voltage: Array | float) -> Array:
        """Compute the ``actuator_gainprm`` of a robot's servos at a supply, (..., n, 10).

        Position mode sets a share of the supply, so that stiffness and largest drive voltage both
        follow it; its motors lose torque to back-EMF as they turn. A current loop makes up for
        that within the supply, (...) [V]: the stiffness is that of the nominal supply, and the
        damping is that of the D gain alone.
        """
        models = [joint.servo.model for joint in robot.joints]
        voltage = np.asarray(voltage, dtype=float)[..., None]
        damping = robot.current_damping if self.damping is None else self.damping
        gains = np.zeros((*voltage.shape[:-1], robot.n, GAIN_COLUMNS))
        gains[..., RESISTANCE] = [m.resistance for m in models]
        gains[..., MOTOR_CONSTANT] = robot.motor_constant
        own = robot.individual.strength
        stiffness = robot.position_gain * self.gain_scale * own
        gains[..., KP] = stiffness * np.where(self.by_current, 1.0, voltage / robot.nominal_voltage)
        gains[..., KD] = np.where(self.by_current, damping, robot.torque_speed_slope)
        gains[..., VMAX] = voltage * self.pwm * np.where(self.by_current, 1.0, own)
        return gains


def limit_servos(
    robot: Robot,
    torque_limit: Array | float,
    by: LimitModes,
    *,
    gain_scale: Array | float = 1.0,
    pwm_limit: Array | float = 1.0,
) -> Drive:
    """Limit the torque of a robot's servos by a mode.

    Goal Current and Goal PWM are whole counts, rounded down. By current, the limit holds at any
    speed that the supply allows. By PWM it holds at standstill: there is less torque the faster
    the servo turns, and more while the joint is turned against its motor. Limp joints get none.

    Args:
        robot: Robot whose servos are limited.
        torque_limit: [N·m], shape (..., n).
        by: Mode of all servos, or of each row, shape (..., 1).
        gain_scale: Share of the position gain, shape (..., n).
        pwm_limit: Largest share of the supply by itself, shape (..., n).
    """
    mode = LIMIT_MODES.index(by) if isinstance(by, str) else by
    is_pwm, is_current = np.equal(mode, PWM), np.equal(mode, CURRENT)
    limit = robot.strength * torque_limit
    share = np.where(is_pwm, round_pwm(limit / robot.max_torque), 1.0)
    pwm = np.minimum(share, round_pwm(pwm_limit))
    torque = np.where(is_pwm, robot.max_torque, limit)
    if np.any(is_current):
        # One limit is for all servos, of which the weaker ones cannot make that torque.
        most = robot.round_current(np.minimum(limit, robot.max_torque))
        torque = np.where(is_current, most, torque)
    return Drive(
        torque=np.where((limit > 0.0) & (pwm > 0.0), torque, 0.0),
        pwm=pwm,
        gain_scale=gain_scale,
        by_current=is_current,
        follows_supply=is_pwm,
    )
