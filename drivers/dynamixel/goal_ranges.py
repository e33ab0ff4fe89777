"""What a servo's goal registers hold: range of positions, counts of a whole supply, gains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.control_table import ControlTable, table_named
from robots import Robot
from robots.servo import MAX_TICKS, PWM_FULL_SCALE

SLOPES = ("cw_compliance_slope", "ccw_compliance_slope")
"""Items of a servo that has a compliance instead of a P gain."""
STIFFEST = 128  # a compliance slope is this divided by the gain, both powers of two
SOFTEST = 1  # gain of the softest slope

Counts = NDArray[np.int_]


def has_slope(table: ControlTable) -> bool:
    """Return whether a servo has a compliance slope instead of a P gain."""
    return SLOPES[0] in table


def goal_range(table: ControlTable) -> tuple[int, int]:
    """Return the goals that a servo takes [ticks]."""
    if table.counts_turns:
        return -MAX_TICKS, MAX_TICKS
    return 0, table["max_position_limit"].upper or 0


def full_scale(table: ControlTable) -> int:
    """Return the counts of the torque limit that are the whole supply."""
    return table["goal_pwm"].upper or PWM_FULL_SCALE if "goal_pwm" in table else PWM_FULL_SCALE


def round_gain(gain: Counts) -> Counts:
    """Round gains down to those that a compliance slope can make, but not below the softest."""
    powers = np.floor(np.log2(np.maximum(gain, SOFTEST)))
    return (2**powers).astype(int)


def to_slope(gain: Counts) -> Counts:
    """Convert gains to compliance slopes; that of gain 0 is the softest."""
    return STIFFEST // round_gain(gain)


class GoalScales:
    """Ranges and scales of the goals of a robot's servos, each of shape (n,)."""

    def __init__(self, robot: Robot) -> None:
        tables = [table_named(joint.servo.model.name) for joint in robot.joints]
        self.lowest, self.highest = np.array([goal_range(t) for t in tables]).T
        """Positions [ticks]."""
        self.full_scale = np.array([full_scale(table) for table in tables])
        """Counts of the torque limit that are the whole supply."""
        self.has_slope = np.array([has_slope(table) for table in tables])
        """Whether it has a compliance slope instead of a P gain."""
