"""Value checks of a servo that depend on its other registers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drivers.dynamixel.control_table import DriveMode, OperatingMode
from drivers.dynamixel.protocol2 import ErrorNumber
from drivers.virtual_bus.devices.registers import Registers

TRIPPED = -1  # value of bus_watchdog after it stopped the servo
NOT_MODELLED = (OperatingMode.CURRENT, OperatingMode.VELOCITY, OperatingMode.PWM)
PROTOCOL_2_TYPE = 2  # value of protocol_type (e-manual)


def make_checks(registers: Registers) -> dict[str, Callable[[int], int]]:
    """Make the check of each item's values; it returns an `ErrorNumber`."""
    # The mask of the model's bits, without that of profiles by time, which are not modelled.
    drive_bits = (registers.table["drive_mode"].upper or 0) & ~DriveMode.TIME_BASED

    def check_range(accepts: Callable[[int], object], value: int) -> int:
        return ErrorNumber.NONE if accepts(value) else ErrorNumber.DATA_RANGE

    def check_position(goal: int) -> int:
        if registers["bus_watchdog"] == TRIPPED:
            return ErrorNumber.DATA_RANGE
        lower, upper = registers["min_position_limit"], registers["max_position_limit"]
        is_free = registers["operating_mode"] != OperatingMode.POSITION
        return ErrorNumber.NONE if is_free or lower <= goal <= upper else ErrorNumber.DATA_LIMIT

    def check_by(limit: str, goal: int) -> int:
        if registers["bus_watchdog"] == TRIPPED:
            return ErrorNumber.DATA_RANGE
        return ErrorNumber.DATA_LIMIT if abs(goal) > registers[limit] else ErrorNumber.NONE

    ranges: dict[str, Callable[[int], object]] = {
        "operating_mode": lambda mode: mode in registers.table.modes and mode not in NOT_MODELLED,
        "drive_mode": lambda bits: not bits & ~drive_bits,
        # A real one speaks Protocol 1.0 after it was set to 1; a virtual one cannot, and refuses.
        "protocol_type": lambda kind: kind == PROTOCOL_2_TYPE,
        "bus_watchdog": lambda value: not value or registers["bus_watchdog"] != TRIPPED,
    }
    return {name: partial(check_range, accepts) for name, accepts in ranges.items()} | {
        "goal_position": check_position,
        "goal_pwm": partial(check_by, "pwm_limit"),
        "goal_current": partial(check_by, "current_limit"),
        "goal_velocity": partial(check_by, "velocity_limit"),
    }
