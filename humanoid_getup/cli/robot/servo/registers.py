"""`getup servo table`, `read`, `write`: the registers of one servo."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.service.loose_servo import LooseServo, open_servo
from humanoid_getup.cli.options.servo import OneServo, ReadRegisters, ShowTable, WriteRegisters
from humanoid_getup.commands.console import console_for, make_table
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.prompt import is_confirmed

NOT_WRITTEN = "nothing is written"
HEADINGS = ("register", "address", "bytes", "counts", "value", "range", "kept")


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
    table = make_table(HEADINGS, left=("register", "value", "kept"))
    rows = {}
    for name, count in values.items():
        item, si = servo.table[name], servo.table.to_si(name, count)
        rows[name] = {"address": item.address, "size": item.size, "value": count, "si": si}
        rows[name] |= {"unit": item.unit, "lower": None, "upper": None, "is_kept": item.eeprom}
        if item.writable:
            rows[name] |= {"lower": item.lower, "upper": item.upper}
        table.add_row(
            name,
            str(item.address),
            str(item.size),
            str(count),
            f"{si:.6g} {item.unit}" if item.unit else "",
            f"{item.lower} to {item.upper}" if item.writable else "read only",
            "yes" if item.eeprom else "",
        )
    write_json(rows, command)
    console = console_for(command)
    console.print(f"[bold]{servo.name}[/], firmware {servo.firmware}")
    console.print(table)
    return DID_IT
