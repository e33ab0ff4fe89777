"""Changes the id, the baud rate and the stored settings of one servo."""

from __future__ import annotations

from dataclasses import replace

from drivers.dynamixel.bus import TRIES
from drivers.dynamixel.diagnostics import GARBLED, read_items
from drivers.dynamixel.protocol1 import PROTOCOL_1
from drivers.dynamixel.protocol2 import Instruction, Reset, is_confirmed
from drivers.errors import SetupError
from drivers.serial_port import PortRefusedError
from drivers.service.scan import TELLTALES
from drivers.service.servos.loose_servo import NOT_LOCKED, LooseServo, ServoError

FACTORY_ID = 1  # as shipped (e-manual)
READS = 3  # of registers that differ between two servos
MISSED = 2  # pings in a row without a reply, of an id that is free


def check_new_id(servo: LooseServo, new: int) -> None:
    """Check that a servo may have an id; nothing is written.

    Raises:
        SetupError: if there is no such id, or another device has it.
    """
    if not 0 <= new <= servo.bus.wire.max_id:
        raise SetupError(f"{servo.name}: id is {new}, expected 0 to {servo.bus.wire.max_id}")
    if new != servo.id and any(servo.bus.ping(new) is not None for _ in range(MISSED)):
        raise SetupError(
            f"port {servo.bus.port.path}: a device has the id {new}, expected a free id"
        )


def check_alone(servo: LooseServo) -> None:
    """Check that no other device has a servo's id: what differs between them is garbled.

    Raises:
        SetupError: if replies are garbled.
    """
    statistics = servo.bus.statistics
    for _ in range(READS):
        before = replace(statistics)
        values = read_items(servo.bus, servo.id, servo.table, TELLTALES)
        since = statistics - before
        if since.damaged or (values is None and since.bytes_in):
            raise SetupError(f"{servo.name}: {GARBLED[0]}; {GARBLED[1]}")


def change_id(servo: LooseServo, new: int) -> LooseServo:
    """Give a servo another id; return it at its new one.

    Raises:
        SetupError: if it may not have it, or has torque.
        ServoError: if it does not reply at its new id; it is locked where it can be reached.
    """
    check_new_id(servo, new)
    if new == servo.id:
        return servo
    check_alone(servo)
    _write_unconfirmed(servo, "id", new)
    moved = replace(servo, id=new)
    if servo.bus.ping(new, TRIES) is None:
        moved.try_lock()
        servo.try_lock()
        raise ServoError(f"{servo.name}: silent at its new id {new}; look for it: getup scan")
    return _lock(moved)


def check_new_baud(servo: LooseServo, new: int) -> int:
    """Check that a servo and its adapter have a baud rate [bit/s]; return its register value.

    Raises:
        SetupError: if one of them does not.
    """
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
    return rates[new]


def change_baud(servo: LooseServo, new: int) -> LooseServo:
    """Give a servo another baud rate [bit/s], and stay with it; the port changes as well.

    Raises:
        SetupError: if servo or adapter do not have it, or the servo has torque.
        ServoError: if it does not reply at its new rate; the port is at the old one then.
    """
    code = check_new_baud(servo, new)
    if new == servo.bus.port.baud:
        return servo
    port = servo.bus.port
    before = port.baud
    _write_unconfirmed(servo, "baud_rate", code)
    port.set_baud(new)
    if servo.bus.ping(servo.id, TRIES) is None:
        servo.try_lock()
        port.set_baud(before)
        servo.try_lock()
        raise ServoError(
            f"{servo.name}: silent at {new} bit/s; look for it: getup scan --all-bauds"
        )
    return _lock(servo)


def reset_servo(servo: LooseServo, kept: Reset) -> LooseServo:
    """Set a servo's stored settings to those as shipped; return it where it replies now.

    Raises:
        SetupError: if it has torque, or if another device would have its id.
        ServoError: if it does not confirm, or does not reply afterwards.
    """
    instead = "write its registers one by one"
    servo.check_instruction(Instruction.FACTORY_RESET, "reset", instead)
    if kept is not Reset.ALL and servo.bus.wire is PROTOCOL_1:
        raise SetupError(f"{servo.name}: a reset sets its id and baud rate too: --keep nothing")
    _check_released(servo)
    new_id = FACTORY_ID if kept is Reset.ALL else servo.id
    shipped = servo.table.bauds[servo.table["baud_rate"].default or 0]
    new_baud = servo.bus.port.baud if kept is Reset.ALL_BUT_ID_AND_BAUD else shipped
    check_new_id(servo, new_id)
    if not is_confirmed(servo.bus.factory_reset(servo.id, kept)):
        raise ServoError(f"{servo.name}: the reset is not confirmed")
    servo.bus.port.set_baud(new_baud)
    return servo.await_reply(new_id)


def _write_unconfirmed(servo: LooseServo, register: str, value: int) -> None:
    """Write a register after which a servo may reply at its old or at its new address."""
    _check_released(servo)
    item = servo.table[register]
    servo.unlock()
    servo.bus.write(servo.id, item.address, item.encode(value))


def _lock(servo: LooseServo) -> LooseServo:
    """Lock what a servo keeps without power again, where it has a lock.

    Raises:
        ServoError: if it does not confirm that.
    """
    if not servo.try_lock():
        raise ServoError(f"{servo.name}: {NOT_LOCKED}")
    return servo


def _check_released(servo: LooseServo) -> None:
    if servo.read("torque_enable"):
        raise SetupError(
            f"{servo.name} has torque, expected none: "
            f"getup servo write torque_enable=0 --id {servo.id}"
        )
