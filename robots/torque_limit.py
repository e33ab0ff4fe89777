"""The torque limit of a robot's servos, and the way in which it acts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from robots.robot import Robot

LimitedBy = Literal["torque", "pwm"]


@dataclass(frozen=True)
class TorqueLimit:
    """A limit on the torque of every servo."""

    value: float | None = None
    """[N·m]; None for no limit below the servos' stall torque."""
    by: LimitedBy = "torque"
    """``"pwm"``: the motor's voltage is limited, as servos in position mode do it, so that less
    torque is left the faster the servo turns. ``"torque"``: ideal, at the torque itself."""

    def __post_init__(self) -> None:
        if self.by not in get_args(LimitedBy):
            expected = " or ".join(map(repr, get_args(LimitedBy)))
            raise ValueError(f"torque limit is by {self.by!r}, expected {expected}")
        if self.value is not None and not 0.0 < self.value < math.inf:
            raise ValueError(
                f"torque limit is {self.value:g} N·m, expected a finite number above 0 N·m"
            )

    @property
    def by_pwm(self) -> bool:
        """Return whether the motor's voltage is limited, not the torque itself."""
        return self.by == "pwm"

    def largest(self, robot: Robot) -> float:
        """Return the largest torque that any servo of a robot may have [N·m]."""
        full = float(robot.max_torque.max())
        return full if self.value is None else min(self.value, full)


FULL_TORQUE = TorqueLimit()
"""No limit: all the torque that the servos have."""
