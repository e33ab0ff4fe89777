"""The torque limit of a robot's servos, and the way in which it acts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import get_args

from robots.arguments import expect
from robots.robot import Robot
from robots.servo import PWM_FULL_SCALE, LimitMode


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
