"""A servo on a port, known by its control table alone."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from difflib import get_close_matches

from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import ControlTable, Item, table_for
from drivers.dynamixel.diagnostics import GARBLED, read_items
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction, Status, read_identity
from drivers.dynamixel.robot_ports import using_margin
from drivers.dynamixel.startup import BOOT_MARGIN, BOOT_TIME, SETUP_MARGIN
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.errors import DriverError, SetupError
from drivers.serial_port import PortRefusedError, SerialPort
from drivers.service.scan import COMMON_RATES, check_rate
from drivers.service.sweep import choose_wires, sweep

# Under torque, a servo obeys these alone: everything else waits until it is released.
HARMLESS = ("led", "torque_enable")
MOTION = ("goal_pwm", "goal_current", "goal_velocity", "goal_position")
"""Registers that move a servo, which only the guard may."""

ADDRESS = {
    "id": "after it the servo replies elsewhere: getup servo id does that",
    "baud_rate": "after it the servo replies elsewhere: getup servo baud does that",
    "protocol_type": "after it the servo has another table: DYNAMIXEL Wizard does that",
}
"""Registers that change how a servo is reached, and why they are not written as others are."""


@dataclass(frozen=True)
class LooseServo:
    """A servo on a port that is open at its baud rate."""

    bus: DynamixelBus
    id: int
    table: ControlTable
    firmware: int

    @property
    def name(self) -> str:
        """Return its name in messages."""
        return f"{self.table.model} (id {self.id})"

    def find_item(self, register: str) -> Item:
        """Find a register by name."""
        if register in self.table:
            return self.table[register]
        near = get_close_matches(register, self.table.items, n=3)
        expected = ", ".join(near) if near else "a name of: getup servo table"
        raise SetupError(f"{self.name} has no register '{register}', expected {expected}")

    def read(self, register: str) -> int:
        """Read a register, in counts."""
        item = self.find_item(register)
        value = self.bus.read_item(self.id, item)
        if value is None:
            raise DriverError(f"{self.name}: silent when {register} is read")
        return value

    def read_table(self) -> dict[str, int]:
        """Read all registers but the indirect ones, by name, in counts."""
        names = [item.name for item in self.table if not item.name.startswith("indirect_")]
        values = read_items(self.bus, self.id, self.table, names)
        if values is None:
            raise DriverError(f"{self.name}: its registers cannot be read")
        return {name: values[name] for name in names}

    def check_write(self, register: str, value: int) -> Item:
        """Check that a register may be written with a value; nothing is written."""
        item = self.find_item(register)
        if not item.writable:
            raise SetupError(f"{self.name}: {register} can only be read")
        if not item.accepts(value) or (
            register == "operating_mode" and value not in self.table.modes
        ):
            raise SetupError(
                f"{self.name}: {register} is {value}, expected {_describe(self, item)}"
            )
        if register in ADDRESS:
            raise SetupError(f"{self.name}: {register} is not written, {ADDRESS[register]}")
        moves = register in MOTION or register.startswith("indirect_")
        if moves or (register == "torque_enable" and value):
            raise SetupError(
                f"{self.name}: {register} may move it, which only the guard does: getup servo move"
            )
        return item

    def write(self, register: str, value: int) -> None:
        """Write a register, in counts, and read it back."""
        item = self.check_write(register, value)
        if register not in HARMLESS:
            self.check_released()
        with self.unlocked(item):
            status = self.bus.write(self.id, item.address, item.encode(value), TRIES)
            if status is not None:  # it may be set to reply to reads alone
                _check_status(self, f"{register} = {value}", status)
        if (found := self.read(register)) != value:
            raise DriverError(f"{self.name}: {register} reads {found} after {value} was written")

    @contextmanager
    def unlocked(self, item: Item) -> Iterator[None]:
        """Make what is written to an item last without power, inside the block."""
        if not item.eeprom:
            yield
            return
        self.unlock()
        try:
            yield
        except BaseException:
            self.set_lock(1)
            raise
        self.lock()

    def unlock(self) -> None:
        """Open the lock of what it keeps without power, where it has one."""
        if not self.set_lock(0):
            self.set_lock(1)
            raise DriverError(
                f"{self.name}: {self.table.keeps_by_lock} = 0 is not confirmed: nothing is written"
            )

    def lock(self) -> LooseServo:
        """Close that lock again; return the servo."""
        if not self.set_lock(1):
            raise DriverError(
                f"{self.name}: its settings stay unlocked, for it does not confirm eeprom_lock = "
                "1: check its cable, then getup servo write eeprom_lock=1"
            )
        return self

    def set_lock(self, value: int) -> bool:
        """Open (0) or close (1) it; return whether it is so, or there is none."""
        lock = self.table.keeps_by_lock
        if lock is None or self.bus.write_item(self.id, self.table[lock], value):
            return True
        return self.bus.read_item(self.id, self.table[lock]) == value

    def check_released(self) -> None:
        """Check that it has no torque."""
        if self.read("torque_enable"):
            raise SetupError(
                f"{self.name} has torque, expected none: "
                f"getup servo write torque_enable=0 --id {self.id}"
            )

    def check_instruction(self, instruction: Instruction, what: str, instead: str) -> None:
        """Check that it knows an instruction."""
        if instruction not in self.table.instructions:
            raise SetupError(f"{self.name} knows no {what} over its bus: {instead}")

    def reboot(self) -> LooseServo:
        """Restart it, and wait until it replies again."""
        self.check_instruction(Instruction.REBOOT, "restart", "switch its power off and on")
        _check_status(self, "reboot", self.bus.reboot(self.id, TRIES))
        return self.await_reply(self.id)

    def await_reply(self, servo_id: int) -> LooseServo:
        """Wait until it replies at an id after a restart."""
        until = time.monotonic() + BOOT_TIME
        with using_margin((self.bus,), BOOT_MARGIN):
            while time.monotonic() < until:
                if self.bus.ping(servo_id) is not None:
                    return replace(self, id=servo_id)
        raise DriverError(f"{self.name}: silent {BOOT_TIME:g} s after its restart")


@contextmanager
def open_servo(
    path: str, servo_id: int | None, baud: int | None, protocol: str | None = None
) -> Iterator[LooseServo]:
    """Open a port and find a servo on it; torque stays as it is.

    Args:
        path: Serial port.
        servo_id: Id of the servo; None for the only one on the port.
        baud: Baud rate [bit/s]; None for the first of `COMMON_RATES` at which it replies.
        protocol: What it speaks; None for that in which it replies.
    """
    with open_bus(path, COMMON_RATES[0] if baud is None else baud, protocol) as bus:
        yield find_servo(bus, servo_id, COMMON_RATES if baud is None else (baud,))


@contextmanager
def open_bus(path: str, baud: int, protocol: str | None = None) -> Iterator[DynamixelBus]:
    """Open a port at a baud rate [bit/s], to look for servos of a protocol, or of any."""
    try:
        check_rate(baud)
    except ValueError as error:
        raise SetupError(str(error)) from error
    wires = choose_wires(protocol)
    port = SerialPort(path, baud)
    port.open()
    try:
        yield DynamixelBus(port, answer_margin=SETUP_MARGIN, wire=wires[0], searched=wires)
    finally:
        port.close()


def find_servo(bus: DynamixelBus, servo_id: int | None, rates: Sequence[int]) -> LooseServo:
    """Find a servo on an open port at one of several baud rates [bit/s], and stay at its rate."""
    found = find_servos(bus, rates, () if servo_id is None else (servo_id,))
    if len(found) > 1:
        listed = ", ".join(str(servo.id) for servo in found)
        raise SetupError(
            f"port {bus.port.path}: servos {listed} reply, expected --id with one of them"
        )
    return found[0]


def find_servos(
    bus: DynamixelBus, rates: Sequence[int], ids: Sequence[int] = ()
) -> list[LooseServo]:
    """Find the servos of some ids, or all, at the first of several baud rates with a reply.

    The port stays at that rate.
    """
    for find in (_find_by_ping, _find_by_sweep):  # which takes longer: a wait for each silent id
        for rate in rates:
            try:
                bus.port.set_baud(rate)
            except PortRefusedError:
                continue  # the adapter does not have it
            if found := find(bus, ids):
                missing = set(ids) - {servo.id for servo in found}
                if missing:
                    raise _no_servo(bus, sorted(missing), (rate,))
                return found
    raise _no_servo(bus, ids, rates)


def _find_by_ping(bus: DynamixelBus, ids: Sequence[int]) -> list[LooseServo]:
    if PROTOCOL_2 not in bus.searched:
        return []
    bus.wire, damaged = PROTOCOL_2, bus.statistics.damaged
    if ids:
        return _list_present(bus, [i for i in sorted(ids) if i <= PROTOCOL_2.max_id])
    found = _list_present(bus, sorted(bus.ping_all()))
    if not found and bus.statistics.damaged > damaged:
        raise SetupError(f"port {bus.port.path}: {GARBLED[0]}; {GARBLED[1]}")
    return found


def _find_by_sweep(bus: DynamixelBus, ids: Sequence[int]) -> list[LooseServo]:
    return _list_present(bus, sweep(bus, bus.searched, ids or None))


def _list_present(bus: DynamixelBus, ids: Sequence[int]) -> list[LooseServo]:
    """List the servos of some ids that reply; boards are left out."""
    found = []
    for servo_id in ids:
        if (pong := bus.ping(servo_id, TRIES)) is not None:
            number, firmware = read_identity(pong)
            table = table_for(number, firmware, bus.wire)
            if table.is_servo:
                found.append(LooseServo(bus, servo_id, table, firmware))
    return found


def _no_servo(bus: DynamixelBus, ids: Sequence[int], rates: Sequence[int]) -> SetupError:
    who = f"no servo of id {', '.join(map(str, ids))} replies" if ids else "no servo replies"
    at = ", ".join(map(str, rates))
    return SetupError(
        f"port {bus.port.path}: {who} at {at} bit/s; check its power and its cable, "
        "getup servo list --all-bauds tries every baud rate"
    )


def _describe(servo: LooseServo, item: Item) -> str:
    if item.name == "operating_mode":
        return ", ".join(map(str, servo.table.modes))
    lower, upper = item.lower or 0, item.upper or 0
    if not item.unit:
        return f"{lower} to {upper}"
    ends = [servo.table.to_si(item.name, count) for count in (lower, upper)]
    return f"{lower} to {upper} ({ends[0]:g} to {ends[1]:g} {item.unit})"


def _check_status(servo: LooseServo, what: str, status: Status | None) -> None:
    if status is None:
        raise DriverError(f"{servo.name}: {what} is not confirmed: silent; check cable and power")
    if status.number:
        try:
            reason = ErrorNumber(status.number).name.lower().replace("_", " ")
        except ValueError:
            reason = "unknown"
        raise DriverError(f"{servo.name}: {what} is refused: error {status.number}, {reason}")
