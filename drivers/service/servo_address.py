"""Changes the id, the baud rate and the stored settings of a servo, or of a robot's servos."""

from __future__ import annotations

from dataclasses import replace

from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import ControlTable, table_named, types_of
from drivers.dynamixel.diagnostics import GARBLED, name_of, read_items
from drivers.dynamixel.protocol1 import PROTOCOL_1
from drivers.dynamixel.protocol2 import Instruction, Reset, is_confirmed
from drivers.dynamixel.robot_ports import find_bus
from drivers.errors import DriverError, SetupError
from drivers.serial_port import PortRefusedError
from drivers.service.loose_servo import LooseServo, find_servos
from drivers.service.scan import TELLTALES
from robots import Joint, Robot
from robots.bus_settings import BAUD_RATES

FACTORY_ID = 1  # as shipped (e-manual)
READS = 3  # of registers that differ between two servos
MISSED = 2  # pings in a row without a reply, of an id that is free


def check_new_id(servo: LooseServo, new: int) -> None:
    """Check that a servo may have an id; nothing is written."""
    if not 0 <= new <= servo.bus.wire.max_id:
        raise SetupError(f"{servo.name}: id is {new}, expected 0 to {servo.bus.wire.max_id}")
    if new == servo.id:
        return
    if any(servo.bus.ping(new) is not None for _ in range(MISSED)):
        raise SetupError(
            f"port {servo.bus.port.path}: a device has the id {new}, expected a free id"
        )
    _check_alone(servo)
    servo.check_released()


def _check_alone(servo: LooseServo) -> None:
    """Check that no other device has a servo's id: what differs between them is garbled."""
    statistics = servo.bus.statistics
    for _ in range(READS):
        before = replace(statistics)
        values = read_items(servo.bus, servo.id, servo.table, TELLTALES)
        since = statistics - before
        if since.damaged or (values is None and since.bytes_in):
            raise SetupError(f"{servo.name}: {GARBLED[0]}; {GARBLED[1]}")


def change_id(servo: LooseServo, new: int) -> LooseServo:
    """Give a servo another id; return it at its new one, locked wherever it can be reached."""
    check_new_id(servo, new)
    if new == servo.id:
        return servo
    _write_unconfirmed(servo, "id", new)
    moved = replace(servo, id=new)
    if servo.bus.ping(new, TRIES) is None:
        moved.set_lock(1)
        servo.set_lock(1)
        raise DriverError(
            f"{servo.name}: silent at its new id {new}; look for it: getup servo list"
        )
    return moved.lock()


def check_new_baud(servo: LooseServo, new: int) -> int:
    """Check that a servo and its adapter have a baud rate [bit/s]; return its register value."""
    item = servo.table["baud_rate"]
    rates = {rate: code for code, rate in servo.table.bauds.items() if item.accepts(code)}
    if new not in rates:
        listed = ", ".join(map(str, sorted(rates)))
        raise SetupError(f"{servo.name}: baud rate is {new} bit/s, expected {listed}")
    port = servo.bus.port
    before = port.baud
    try:
        port.set_baud(new)
    except PortRefusedError as error:
        raise SetupError(f"{error}; nothing is written") from error
    finally:
        port.set_baud(before)
    if new != before:
        servo.check_released()
    return rates[new]


def change_baud(servo: LooseServo, new: int) -> LooseServo:
    """Give a servo and its port another baud rate [bit/s]; the port's old one if it is silent."""
    code = check_new_baud(servo, new)
    if new == servo.bus.port.baud:
        return servo
    port = servo.bus.port
    before = port.baud
    _write_unconfirmed(servo, "baud_rate", code)
    port.set_baud(new)
    if servo.bus.ping(servo.id, TRIES) is None:
        servo.set_lock(1)
        port.set_baud(before)
        servo.set_lock(1)
        raise DriverError(
            f"{servo.name}: silent at {new} bit/s; look for it: getup servo list --all-bauds"
        )
    return servo.lock()


def check_reset(servo: LooseServo, kept: Reset) -> None:
    """Check that a servo may be reset; nothing is written."""
    instead = "write its registers one by one"
    servo.check_instruction(Instruction.FACTORY_RESET, "reset", instead)
    if kept is not Reset.ALL and servo.bus.wire is PROTOCOL_1:
        raise SetupError(f"{servo.name}: a reset sets its id and baud rate too: --keep nothing")
    servo.check_released()
    if kept is Reset.ALL:
        check_new_id(servo, FACTORY_ID)


def reset_servo(servo: LooseServo, kept: Reset) -> LooseServo:
    """Set a servo's stored settings to those as shipped; return it where it replies now."""
    check_reset(servo, kept)
    if not is_confirmed(servo.bus.factory_reset(servo.id, kept)):
        raise DriverError(f"{servo.name}: the reset is not confirmed")
    if kept is not Reset.ALL_BUT_ID_AND_BAUD:
        servo.bus.port.set_baud(_shipped_baud(servo.table))
    return servo.await_reply(FACTORY_ID if kept is Reset.ALL else servo.id)


def set_up_servo(bus: DynamixelBus, robot: Robot, joint: Joint) -> tuple[int, int]:
    """Give the only servo on a bus the id of a joint and the baud rate of its robot.

    Returns:
        Its id and its baud rate [bit/s] before.
    """
    baud, table = find_bus(robot).baud, table_named(robot.joints[0].servo.model.name)
    bus.searched = (table.wire,)
    rates = dict.fromkeys((baud, _shipped_baud(table), *BAUD_RATES))
    servo, *others = find_servos(bus, list(rates))
    if others:
        listed = ", ".join(str(each.id) for each in (servo, *others))
        raise SetupError(
            f"port {bus.port.path}: servos {listed} reply, expected one: unplug the others"
        )
    if joint.servo.model.name not in types_of(servo.table):
        raise SetupError(
            f"{servo.name} is on the bus, expected a {joint.servo.model.name} for {name_of(joint)}"
        )
    before = servo.id, bus.port.baud
    change_baud(change_id(servo, joint.servo.id), baud)
    return before


def _shipped_baud(table: ControlTable) -> int:
    return table.bauds[table["baud_rate"].default or 0]


def _write_unconfirmed(servo: LooseServo, register: str, value: int) -> None:
    """Write a register after which a servo may reply at its old or at its new address."""
    item = servo.table[register]
    servo.unlock()
    servo.bus.write(servo.id, item.address, item.encode(value))
