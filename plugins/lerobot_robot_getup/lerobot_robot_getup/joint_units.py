"""Units of ``<joint>.pos``: degrees from the model's zero, or percent of half the range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import Robot
from robots.quaternion import Array

HALF_RANGE = 100.0


@dataclass(frozen=True, eq=False)
class JointUnits:
    """Converts joint angles to LeRobot's numbers and back; both maps are linear."""

    zero: Array
    """Angles at which the number is 0 [rad], (n,)."""
    scale: Array
    """Numbers per radian, (n,)."""

    @classmethod
    def of(cls, robot: Robot, *, use_degrees: bool) -> JointUnits:
        """Make the units of a robot's joints."""
        if use_degrees:
            return cls(np.zeros(robot.n), np.full(robot.n, np.degrees(1.0)))
        return cls(
            0.5 * (robot.lower + robot.upper), 2.0 * HALF_RANGE / (robot.upper - robot.lower)
        )

    def from_angles(self, joint_pos: Array) -> Array:
        """Convert angles [rad] to numbers, (n,)."""
        return (joint_pos - self.zero) * self.scale

    def to_angles(self, numbers: Array) -> Array:
        """Convert numbers to angles [rad], (n,)."""
        return numbers / self.scale + self.zero
