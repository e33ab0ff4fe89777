"""How currents are written: of a servo without a sensor they are estimates, and it is said."""

from __future__ import annotations

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.group_layout import GroupLayout
from robots import Joint

ESTIMATE = "estimated from the load"


def is_estimated(joint: Joint) -> bool:
    """Return whether the current of a joint's servo is estimated from its load."""
    return not GroupLayout.of(table_named(joint.servo.model.name)).measures_current


def describe_current(current: float, *, estimated: bool) -> str:
    """Write a current [A], and that it is an estimate."""
    return f"~{current:.2f} A ({ESTIMATE})" if estimated else f"{current:.2f} A"
