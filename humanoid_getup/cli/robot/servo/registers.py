"""`getup servo table`, `read`, `write`: the registers of one servo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.service.loose_servo import LooseServo, open_servo
from humanoid_getup.cli.options.servo import OneServo, ReadRegisters, ShowTable, WriteRegisters
from humanoid_getup.cli.shared.console import console_for, make_table
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import is_confirmed
from humanoid_getup.jobs.errors import BadInputError

NOT_WRITTEN = "nothing is written"
HEADINGS = ("register", "address", "bytes", "counts", "value", "range", "kept")


@dataclass(frozen=True, kw_only=True)
class RegisterRow:
    """A register of a servo, for JSON."""

    address: int
    size: int
    """[bytes]"""
    value: int
    """[counts]"""
    si: float
    """The same in its unit; a position is an angle from the middle of the turn."""
    unit: str
    lower: int | None
    """Least value that may be written [counts]; None if it can only be read."""
    upper: int | None
    is_kept: bool
    """Whether it is kept without power."""


def show_table(command: ShowTable) -> int:
    """Print all registers of a servo."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        values = servo.read_table()
    return _show(servo, values, command)


def read_registers(command: ReadRegisters) -> int:
    """Read the registers that are named."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        for name in command.names:
            servo.find_item(name)
        values = {name: servo.read(name) for name in command.names}
    return _show(servo, values, command)


def write_registers(command: WriteRegisters) -> int:
    """Write registers; 1 if the person declined."""
    wanted = dict(map(_parse, command.values))
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        items = [servo.check_write(name, value) for name, value in wanted.items()]
        kept = ", ".join(item.name for item in items if item.eeprom)
        question = f"{servo.name} keeps {kept} without power: write?"
        console = console_for(command)
        if kept and not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return DID_NOT_STAND
        for name, value in wanted.items():
            servo.write(name, value)
        values = {name: servo.read(name) for name in wanted}
    return _show(servo, values, command)


def _parse(text: str) -> tuple[str, int]:
    """Read NAME=COUNTS."""
    name, _, value = text.partition("=")
    try:
        return name, int(value, 0)
    except ValueError:
        raise BadInputError(
            f"'{text}' is no register and value, expected NAME=COUNTS, a whole number, such as "
            "temperature_limit=70"
        ) from None


def _show(servo: LooseServo, values: Mapping[str, int], command: OneServo) -> int:
    write_json({name: _describe(servo, name, count) for name, count in values.items()}, command)
    table = make_table(HEADINGS, left=("register", "value", "kept"))
    for name, count in values.items():
        item = servo.table[name]
        table.add_row(
            name,
            str(item.address),
            str(item.size),
            str(count),
            f"{servo.table.to_si(name, count):.6g} {item.unit}" if item.unit else "",
            f"{item.lower} to {item.upper}" if item.writable else "read only",
            "yes" if item.eeprom else "",
        )
    console = console_for(command)
    console.print(f"[bold]{servo.name}[/], firmware {servo.firmware}")
    console.print(table)
    return DID_IT


def _describe(servo: LooseServo, name: str, count: int) -> RegisterRow:
    item = servo.table[name]
    return RegisterRow(
        address=item.address,
        size=item.size,
        value=count,
        si=servo.table.to_si(name, count),
        unit=item.unit,
        lower=item.lower if item.writable else None,
        upper=item.upper if item.writable else None,
        is_kept=item.eeprom,
    )
