"""Behavior that all devices on a Dynamixel bus share."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from drivers.dynamixel.control_table import ControlTable
from drivers.dynamixel.protocol2 import ALERT, ErrorNumber, Instruction, Status
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.virtual_bus.devices.registers import Registers, WritePlan

# Status return level from which reads are answered, and from which everything is.
READ_LEVEL, ALL_LEVEL = 1, 2
Handler = Callable[[bytes], int]


class ReadGap(Enum):
    """Behavior of the devices listed after a silent one in a group read."""

    SLOT_STAYS_EMPTY = "each waits for its own slot, the silent one's stays empty"
    CHAIN_BREAKS = "each waits for the one before it, so all after a silent one are silent"


@dataclass(frozen=True, kw_only=True)
class Quirks:
    """Choices for device behavior that the e-manual leaves open, to test a driver against both."""

    sync_gap: ReadGap = ReadGap.SLOT_STAYS_EMPTY
    """A silent member of a sync or bulk read. The manual shows complete replies only and does not
    say how a device recognizes its turn."""
    fast_gap: ReadGap = ReadGap.CHAIN_BREAKS
    """The same in a fast read, whose single frame is incomplete then: the manual does not say
    whether later devices still send their pieces."""
    goal_switches_torque_on: bool = True
    """Whether a servo without drive modes (AX, MX(1.0), XL-320, Feetech) switches torque on when
    a goal is written; users report that of AX and Feetech's, and no manual says it."""
    reboot_time: float = 0.3
    """Silence after a reboot or power-up [s]; not in the manual."""


class VirtualDevice:
    """Executes ping, read, write, reg write and action on a control table.

    Subclasses add instructions to ``_handlers``, value checks to ``_checks`` and side effects of
    writes to ``_effects``.
    """

    def __init__(
        self, table: ControlTable, device_id: int, firmware: int, baud: int, quirks: Quirks
    ) -> None:
        """Build a device with its registers at factory defaults, its speed in bit/s."""
        self.table, self.quirks, self.firmware = table, quirks, firmware
        self.registers = Registers(table)
        self.alarms = 0
        """Hardware errors, as bits of `HardwareError`; replies of some protocols name them."""
        self.alive = True
        """False behind a broken cable: it neither receives nor replies."""
        self._powered = True
        self._booted_at = -1.0  # s; no instruction reaches it before
        self.now = 0.0
        self._traffic_at = 0.0
        self._stored: tuple[int, bytes] | None = None
        self._at_id = table["id"].address
        self._at_baud = table["baud_rate"].address
        self._at_level = table["status_return_level"].address
        self._at_delay = table["return_delay_time"].address
        self._least_level = ALL_LEVEL - table.all_answered
        self._handlers: dict[int, Handler] = {
            Instruction.WRITE: self._handle_write,
            Instruction.REG_WRITE: self._handle_reg_write,
            Instruction.ACTION: self._handle_action,
        }
        self._checks: dict[str, Callable[[int], int]] = {}
        self._effects: dict[str, Callable[[int], None]] = {}
        self.has_fast_read = table.supports_fast_read(firmware)
        registers = self.registers
        registers["id"], registers["firmware_version"] = device_id, firmware
        registers["baud_rate"] = table.baud_code(baud)

    @property
    def id(self) -> int:
        """Return its id on the bus."""
        return self.registers.memory[self._at_id]

    @property
    def baud(self) -> int:
        """Return its baud rate [bit/s]."""
        return self.table.bauds.get(self.registers.memory[self._at_baud], 0)

    @property
    def return_delay(self) -> float:
        """Return the time between an instruction and its reply [s]."""
        return self.registers.memory[self._at_delay] * 2e-6

    @property
    def listens(self) -> bool:
        """Return whether instructions reach it."""
        return self.alive and self._powered and self.now >= self._booted_at

    @property
    def answers_reads(self) -> bool:
        """Return whether its status return level makes it reply to reads."""
        return self._return_level >= READ_LEVEL

    @property
    def _return_level(self) -> int:
        """Return its status return level; of a servo that always answers reads, from 1 on."""
        return self.registers.memory[self._at_level] + self._least_level

    @property
    def alert(self) -> int:
        """Return the alert bit of its replies, set while there is a hardware error."""
        return ALERT if self.alarms else 0

    @property
    def powered(self) -> bool:
        """Return whether it has power; switching that on boots it."""
        return self._powered

    @powered.setter
    def powered(self, on: bool) -> None:
        if on and not self._powered:
            self._powered = True
            self._boot()
        elif not on and self._powered:
            self._powered = False
            self._lose_power()

    def peek(self, name: str) -> int:
        """Return a register's value."""
        return self.registers[name]

    def poke(self, name: str, value: int) -> None:
        """Set a register, regardless of access rights and range."""
        self.registers[name] = value

    def note_traffic(self) -> None:
        """Reset the bus watchdog."""
        self._traffic_at = self.now

    def advance(self, now: float) -> None:
        """Advance to a bus time [s]."""
        self.now = now

    def handle(
        self, instruction: int, params: bytes = b"", *, is_broadcast: bool = False
    ) -> Status | None:
        """Execute an instruction; return the reply, None for none."""
        self.note_traffic()
        # The instruction may change these values: the reply uses the old ones.
        device_id, alert, level = self.id, self.alert, self._return_level
        alarms = self.alarms
        if instruction == Instruction.PING:
            data = self._identity()
            return None if is_broadcast else Status(device_id, alert, data, alarms)
        if instruction == Instruction.READ:
            if is_broadcast or level < READ_LEVEL:
                return None
            error, data = ErrorNumber.DATA_LENGTH, b""
            if len(params) == 4:
                error, data = self.read(*struct.unpack("<HH", params))
            return Status(device_id, error | alert, data, alarms)
        handler = self._handlers.get(instruction)
        error = handler(params) if handler else ErrorNumber.INSTRUCTION
        if is_broadcast or level <= READ_LEVEL:
            return None
        return Status(device_id, error | alert, alarms=alarms)

    def read(self, address: int, length: int) -> tuple[int, bytes]:
        """Return an `ErrorNumber` and the bytes of a span."""
        self.note_traffic()
        return self.registers.read(address, length)

    def write(self, address: int, data: bytes) -> int:
        """Set registers, all of them or none; return an `ErrorNumber`."""
        self.note_traffic()
        error, plan, values = self._check_write(address, data)
        if error:
            return error
        memory = self.registers.memory
        for field, value in zip(plan.fields, values, strict=True):
            field.codec.pack_into(memory, field.address, value)
            effect = self._effects.get(field.name)
            if effect is not None:
                effect(value)
        if plan.remaps:
            self.registers.clear_plans()
        return ErrorNumber.NONE

    def _check_write(self, address: int, data: bytes) -> tuple[int, WritePlan, list[int]]:
        """Check a write: return an `ErrorNumber`, or the items and their values."""
        plan = self.registers.plan_write(address, len(data))
        values: list[int] = []
        if plan.error:
            return plan.error, plan, values
        if plan.eeprom and self._is_locked():
            return ErrorNumber.ACCESS, plan, values
        for field in plan.fields:
            value = field.codec.unpack_from(data, field.offset)[0]
            if not field.lower <= value <= field.upper:
                return ErrorNumber.DATA_RANGE, plan, values
            check = self._checks.get(field.name)
            if check is not None and (error := check(value)):
                return error, plan, values
            values.append(value)
        return ErrorNumber.NONE, plan, values

    # Instructions --------------------------------------------------------------------------

    def _identity(self) -> bytes:
        """Return model number and firmware version, as a ping names them in Protocol 2.0 alone."""
        if self.table.wire is not PROTOCOL_2:
            return b""
        firmware = self.registers["firmware_version"]
        return struct.pack("<HB", self.registers["model_number"], firmware)

    def _handle_write(self, params: bytes) -> int:
        if len(params) < 3:
            return ErrorNumber.DATA_LENGTH
        return self.write(params[0] | params[1] << 8, params[2:])

    def _handle_reg_write(self, params: bytes) -> int:
        if len(params) < 3:
            return ErrorNumber.DATA_LENGTH
        address, data = params[0] | params[1] << 8, params[2:]
        error, _, _ = self._check_write(address, data)
        if not error:
            self._store_write((address, data))
        return error

    def _handle_action(self, _params: bytes) -> int:
        if self._stored is None:
            return ErrorNumber.INSTRUCTION
        address, data = self._stored
        self._store_write(None)
        return self.write(address, data)

    def _store_write(self, stored: tuple[int, bytes] | None) -> None:
        self._stored = stored
        if "registered_instruction" in self.registers:
            self.registers["registered_instruction"] = int(stored is not None)

    # For subclasses ----------------------------------------------------------------------

    def _is_locked(self) -> bool:
        return False

    def _boot(self) -> None:
        """Restart with power-up values after the reboot time."""
        self._stored = None
        self._booted_at = self.now + self.quirks.reboot_time

    def _lose_power(self) -> None:
        """Clear the values that are lost without power."""
        self._stored = None
