"""Value checks of a servo that depend on its other registers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.dynamixel.control_table import DriveMode, OperatingMode
from drivers.dynamixel.protocol2 import ErrorNumber
from drivers.virtual_bus.devices.quirks import Quirks
from drivers.virtual_bus.devices.registers import Registers

TRIPPED = -1  # value of bus_watchdog after it stopped the servo
LONGEST_PROFILE = 32737  # ms, of a time-based profile (e-manual)


class WriteRules:
    """Checks values against other registers; each check returns an `ErrorNumber`."""

    def __init__(self, registers: Registers, quirks: Quirks) -> None:
        self._registers, self._quirks = registers, quirks
        self._drive_bits = registers.table["drive_mode"].upper or 0
        self.checks: Mapping[str, Callable[[int], int]] = {
            "operating_mode": self._check_mode,
            "drive_mode": self._check_drive_mode,
            "bus_watchdog": self._check_watchdog,
            "profile_velocity": self._check_profile,
            "profile_acceleration": self._check_profile,
            "goal_position": self._check_goal_position,
            "goal_pwm": self._check_by("pwm_limit"),
            "goal_current": self._check_by("current_limit"),
            "goal_velocity": self._check_by("velocity_limit"),
        }

    def _check_mode(self, mode: int) -> int:
        known = mode in self._registers.table.modes
        return ErrorNumber.NONE if known else ErrorNumber.DATA_RANGE

    def _check_drive_mode(self, bits: int) -> int:
        # The upper end of its range is the mask of the model's bits.
        return ErrorNumber.DATA_RANGE if bits & ~self._drive_bits else ErrorNumber.NONE

    def _check_watchdog(self, value: int) -> int:
        stays = value and self._registers["bus_watchdog"] == TRIPPED
        return ErrorNumber.DATA_RANGE if stays else ErrorNumber.NONE

    def _check_profile(self, value: int) -> int:
        too_long = value > LONGEST_PROFILE and self._registers["drive_mode"] & DriveMode.TIME_BASED
        return ErrorNumber.DATA_RANGE if too_long else ErrorNumber.NONE

    def _check_goal_position(self, goal: int) -> int:
        registers = self._registers
        if registers["bus_watchdog"] == TRIPPED:
            return ErrorNumber.DATA_RANGE
        if registers["operating_mode"] != OperatingMode.POSITION:
            return ErrorNumber.NONE
        if registers["min_position_limit"] <= goal <= registers["max_position_limit"]:
            return ErrorNumber.NONE
        return self._quirks.limit_error

    def _check_by(self, limit: str) -> Callable[[int], int]:
        registers, quirks = self._registers, self._quirks

        def check(goal: int) -> int:
            if registers["bus_watchdog"] == TRIPPED:
                return ErrorNumber.DATA_RANGE
            return quirks.limit_error if abs(goal) > registers[limit] else ErrorNumber.NONE

        return check
