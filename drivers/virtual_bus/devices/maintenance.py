"""Reboot and factory reset: which registers keep their values."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from drivers.dynamixel.control_table import ControlTable, Item
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction, Reset
from drivers.virtual_bus.devices.device import Addressing, Handler
from drivers.virtual_bus.devices.registers import Registers

GAINS = (
    "velocity_i_gain",
    "velocity_p_gain",
    "position_d_gain",
    "position_i_gain",
    "position_p_gain",
    "feedforward_2nd_gain",
    "feedforward_1st_gain",
)
PROFILE = ("profile_acceleration", "profile_velocity")
KEPT = {
    Reset.ALL: (),
    Reset.ALL_BUT_ID: ("id",),
    Reset.ALL_BUT_ID_AND_BAUD: ("id", "baud_rate"),
}
CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"
CLEAR_FIRMWARE = 42  # first that has clear, and that refuses a broadcast reset of all


def reset(registers: Registers, items: Iterable[Item]) -> None:
    """Reset items to their defaults; measured ones stay."""
    for item in items:
        if item.default is not None:
            registers[item.name] = item.default


def reset_ram(registers: Registers) -> None:
    """Reset RAM to its power-up values."""
    reset(registers, (item for item in registers.table if not item.eeprom))


class Maintained(Protocol):
    """A servo that is maintained."""

    table: ControlTable
    registers: Registers
    firmware: int

    def reboot(self) -> None:
        """Restart with RAM at its defaults."""

    def clear_turns(self) -> None:
        """Bring the position back into one turn and hold it."""


class Maintenance:
    """Executes reboot, clear and factory reset on one servo."""

    def __init__(self, servo: Maintained) -> None:
        self._servo = servo
        self.handlers: dict[int, Handler] = {
            Instruction.REBOOT: self._reboot,
            Instruction.CLEAR: self._clear,
            Instruction.FACTORY_RESET: self._reset,
        }

    def _reboot(self, params: bytes, addressing: Addressing) -> int:
        del params, addressing
        self._servo.reboot()
        return ErrorNumber.NONE

    def _clear(self, params: bytes, addressing: Addressing) -> int:
        del addressing
        if self._servo.firmware < CLEAR_FIRMWARE:
            return ErrorNumber.INSTRUCTION
        if params != CLEAR_TURNS:
            return ErrorNumber.DATA_RANGE
        if self._servo.registers["moving"]:
            return ErrorNumber.RESULT_FAIL
        self._servo.clear_turns()
        return ErrorNumber.NONE

    def _reset(self, params: bytes, addressing: Addressing) -> int:
        if len(params) != 1:
            return ErrorNumber.DATA_LENGTH
        if params[0] not in set(Reset):
            return ErrorNumber.DATA_RANGE
        kept, servo = Reset(params[0]), self._servo
        if addressing is Addressing.SECONDARY:
            return ErrorNumber.ACCESS
        if (
            addressing is Addressing.BROADCAST
            and kept is Reset.ALL
            and servo.firmware >= CLEAR_FIRMWARE
        ):
            return ErrorNumber.RESULT_FAIL  # every id would become 1
        items = (item for item in servo.table if item.eeprom and item.writable)
        reset(servo.registers, (item for item in items if item.name not in KEPT[kept]))
        servo.reboot()
        return ErrorNumber.NONE
