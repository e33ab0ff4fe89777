"""`getup servo table`, `read`, `write`: the registers of one servo."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from rich.console import Console
from tyro.conf import Positional, arg

from drivers.service.loose_servo import LooseServo, open_servo
from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, make_table
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.options import NO_PORT, JsonOption
from humanoid_getup.commands.prompt import is_confirmed
from robots.storage.validation import between

ID = between(0, 253)
NOT_WRITTEN = "nothing is written"
HEADINGS = ("register", "address", "bytes", "counts", "value", "range", "kept")
Baud = Annotated[int | None, arg(metavar="BIT/S")]
Protocol = Literal["2.0", "1.0", "feetech"]


@dataclass(frozen=True, kw_only=True)
class AnyPortOptions(JsonOption):
    """Options of all commands for servos on one port."""

    port: Annotated[str | None, arg(metavar="PATH")] = None
    """Serial port."""
    baud: Baud = None
    """Baud rate [bit/s]; default: 57600, 1, 2, 3 and 4 Mbit/s are tried until a servo replies."""
    protocol: Protocol | None = None
    """What the servos speak; default: that in which they reply."""


@dataclass(frozen=True, kw_only=True)
class ServoOptions(AnyPortOptions):
    """Options of the commands that need a port."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.port:
            yield NO_PORT


@dataclass(frozen=True, kw_only=True)
class OneServo(ServoOptions):
    """Options of the commands for one servo."""

    id: Annotated[int | None, ID, arg(metavar="ID")] = None
    """Id of the servo; default: that of the only one on the port."""

    def open(self) -> AbstractContextManager[LooseServo]:
        """Open the port and find the servo."""
        return open_servo(self.port or "", self.id, self.baud, self.protocol)


@dataclass(frozen=True, kw_only=True)
class ConfirmedOptions(OneServo):
    """Options of the commands that write to what a servo keeps without power."""

    yes: bool = False
    """Do not ask before something is written that is kept without power."""

    def is_confirmed(self, console: Console, question: str) -> bool:
        """Return whether a person agrees; say so if nothing is written."""
        agrees = is_confirmed(console, f"{question}: write?", yes=self.yes)
        if not agrees:
            console.print(NOT_WRITTEN)
        return agrees


@dataclass(frozen=True, kw_only=True)
class ShowTable(OneServo):
    """Print all registers of a servo: address, size, value, unit and range; changes nothing."""


@dataclass(frozen=True, kw_only=True)
class ReadRegisters(OneServo):
    """Read registers of a servo, in counts and in units."""

    names: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME...")]
    """Names of registers, see getup servo table."""


@dataclass(frozen=True, kw_only=True)
class WriteRegisters(ConfirmedOptions):
    """Write registers of a servo without torque, and read them back.

    Registers that move it are refused: getup servo move does that, guarded.
    """

    values: Annotated[Positional[tuple[str, ...]], arg(metavar="NAME=COUNTS...")]
    """Registers and their values in counts, such as temperature_limit=70."""


@program("servo table")
def show_table(options: ShowTable) -> int:
    """Print all registers of a servo."""
    with options.open() as servo:
        return _show(servo, servo.read_table(), options)


@program("servo read")
def read_registers(options: ReadRegisters) -> int:
    """Read the registers that are named."""
    if not options.names:
        raise ValueError("NAME is missing, expected a register of: getup servo table")
    with options.open() as servo:
        for name in options.names:
            servo.find_item(name)
        return _show(servo, {name: servo.read(name) for name in options.names}, options)


@program("servo write")
def write_registers(options: WriteRegisters) -> int:
    """Write registers; 1 if the person declined."""
    if not options.values:
        raise ValueError("NAME=COUNTS is missing, such as temperature_limit=70")
    wanted = dict(map(_parse, options.values))
    with options.open() as servo:
        items = [servo.check_write(name, value) for name, value in wanted.items()]
        kept = ", ".join(item.name for item in items if item.eeprom)
        question = f"{servo.name} keeps {kept} without power"
        if kept and not options.is_confirmed(console_for(options), question):
            return DID_NOT_STAND
        for name, value in wanted.items():
            servo.write(name, value)
        return _show(servo, {name: servo.read(name) for name in wanted}, options)


def _parse(text: str) -> tuple[str, int]:
    """Read NAME=COUNTS."""
    name, _, value = text.partition("=")
    try:
        return name, int(value, 0)
    except ValueError:
        raise ValueError(
            f"'{text}' is no register and value, expected NAME=COUNTS, a whole number, such as "
            "temperature_limit=70"
        ) from None


def _show(servo: LooseServo, values: Mapping[str, int], options: OneServo) -> int:
    table = make_table(HEADINGS, left=("register", "value", "kept"))
    rows: dict[str, dict[str, Any]] = {}
    for name, count in values.items():
        item, si = servo.table[name], servo.table.to_si(name, count)
        ends = (item.lower, item.upper) if item.writable else (None, None)
        rows[name] = {"address": item.address, "size": item.size, "value": count, "si": si}
        rows[name] |= {
            "unit": item.unit,
            "lower": ends[0],
            "upper": ends[1],
            "is_kept": item.eeprom,
        }
        table.add_row(
            *map(str, (name, item.address, item.size, count)),
            f"{si:.6g} {item.unit}" if item.unit else "",
            f"{item.lower} to {item.upper}" if item.writable else "read only",
            "yes" if item.eeprom else "",
        )
    write_json(rows, options)
    console = console_for(options)
    console.print(f"[bold]{servo.name}[/], firmware {servo.firmware}")
    console.print(table)
    return DID_IT
