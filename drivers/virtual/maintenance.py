"""Maintenance: instructions after which a servo is no longer what it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.protocol2 import ErrorNumber, Instruction, Reset
from drivers.virtual.device import Call, Handler
from drivers.virtual.persistence import Backup, reset_eeprom

if TYPE_CHECKING:
    from drivers.virtual.servo import VirtualServo

CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"
STORE_BACKUP, RESTORE_BACKUP = b"\x01CTRL", b"\x02CTRL"
CLEAR_FIRMWARE = 42  # first that has clear, and that refuses a broadcast reset of all


class Maintenance:
    """Reboot, clear, factory reset and backup of one servo."""

    def __init__(self, servo: VirtualServo, backup: Backup) -> None:
        self._servo, self._backup = servo, backup
        self.handlers: dict[int, Handler] = {
            Instruction.REBOOT: self._reboot,
            Instruction.CLEAR: self._clear,
            Instruction.FACTORY_RESET: self._reset,
            Instruction.BACKUP: self._store_or_restore,
        }

    def _reboot(self, params: bytes, call: Call) -> int:
        del params, call
        self._servo.reboot()
        return ErrorNumber.NONE

    def _clear(self, params: bytes, call: Call) -> int:
        del call
        if self._servo.firmware < CLEAR_FIRMWARE:
            return ErrorNumber.INSTRUCTION
        if params != CLEAR_TURNS:
            return ErrorNumber.DATA_RANGE
        if self._servo.peek("moving"):
            return ErrorNumber.RESULT_FAIL
        self._servo.clear_turns()
        return ErrorNumber.NONE

    def _reset(self, params: bytes, call: Call) -> int:
        if len(params) != 1:
            return ErrorNumber.DATA_LENGTH
        if params[0] not in set(Reset):
            return ErrorNumber.DATA_RANGE
        kept = Reset(params[0])
        if call is Call.SECONDARY:
            return ErrorNumber.ACCESS
        if call is Call.BROADCAST and kept is Reset.ALL and self._servo.firmware >= CLEAR_FIRMWARE:
            return ErrorNumber.RESULT_FAIL  # every id would become 1
        reset_eeprom(self._servo.registers, kept)
        self._servo.reboot()
        return ErrorNumber.NONE

    def _store_or_restore(self, params: bytes, call: Call) -> int:
        servo = self._servo
        if not servo.table.supports_backup(servo.firmware):
            return ErrorNumber.INSTRUCTION
        if params not in (STORE_BACKUP, RESTORE_BACKUP):
            return ErrorNumber.DATA_RANGE
        if servo.torque_on:
            return ErrorNumber.RESULT_FAIL
        if params == STORE_BACKUP:
            self._backup.store(servo.registers)
            servo.poke("backup_ready", 1)
            return ErrorNumber.NONE
        if call is Call.SECONDARY:
            return ErrorNumber.ACCESS
        if not self._backup.is_ready:
            return ErrorNumber.RESULT_FAIL
        self._backup.restore_eeprom(servo.registers)
        servo.reboot(restore=True)
        return ErrorNumber.NONE
