"""`getup servo list`, `table`, `read`, `write`: the registers of servos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table

from drivers.service.scan import COMMON_RATES
from drivers.service.servos.gauges import Gauge, Gauges
from drivers.service.servos.loose_servo import LooseServo, find_any, open_bus, open_servo
from humanoid_getup.cli.options.servo import ListServos, ReadRegisters, ShowTable, WriteRegisters
from humanoid_getup.cli.robot.servo.gauge_table import HEADINGS, LEFT, list_cells
from humanoid_getup.cli.shared.console import console_for, count_of, make_table, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import is_confirmed
from humanoid_getup.jobs.errors import BadInputError

NOT_WRITTEN = "nothing is written"


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


@dataclass(frozen=True, kw_only=True)
class ListedServo:
    """A servo that replies, for JSON."""

    id: int
    model: str
    firmware: int
    baud: int
    """[bit/s]"""
    values: Mapping[str, int]
    """What it measures, by register [counts]."""


def list_servos(command: ListServos) -> int:
    """List the servos on a port; 0 if there are some."""
    console = console_for(command)
    rates = COMMON_RATES if command.baud is None else (command.baud,)
    with phase("searching"), open_bus(command.path, rates[0], command.protocol) as bus:
        gauges = Gauges(bus, find_any(bus, rates))
        gauges.read()
        baud = bus.port.baud
    write_json([_describe_gauge(gauge, baud) for gauge in gauges.all], command)
    console.print(f"[bold]{command.path}[/]: {count_of(len(gauges.all), 'servo')} at {baud} bit/s")
    console.print(tabulate_gauges(gauges.all))
    return DID_IT


def tabulate_gauges(gauges: Sequence[Gauge]) -> Table:
    """Make a table of what servos measure."""
    table = make_table(HEADINGS, left=LEFT)
    for gauge in gauges:
        table.add_row(*list_cells(gauge))
    return table


def show_table(command: ShowTable) -> int:
    """Print all registers of a servo."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        values = servo.read_table()
    _show(servo, values, command)
    return DID_IT


def read_registers(command: ReadRegisters) -> int:
    """Read the registers that are named."""
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        for name in command.names:
            servo.find_item(name)
        values = {name: servo.read(name) for name in command.names}
    _show(servo, values, command)
    return DID_IT


def write_registers(command: WriteRegisters) -> int:
    """Write registers; 1 if the person declined."""
    wanted = dict(map(_parse, command.values))
    console = console_for(command)
    with open_servo(command.path, command.id, command.baud, command.protocol) as servo:
        items = [servo.check_write(name, value) for name, value in wanted.items()]
        kept = [item.name for item in items if item.eeprom]
        question = f"{servo.name} keeps {', '.join(kept)} without power: write?"
        if kept and not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return DID_NOT_STAND
        for name, value in wanted.items():
            servo.write(name, value)
        values = {name: servo.read(name) for name in wanted}
    _show(servo, values, command)
    return DID_IT


def _parse(text: str) -> tuple[str, int]:
    """Read NAME=COUNTS."""
    name, equals, value = text.partition("=")
    try:
        count = int(value, 0)
    except ValueError:
        equals = ""
        count = 0
    if not (name and equals):
        raise BadInputError(
            f"'{text}' is no register and value, expected NAME=COUNTS, a whole number, such as "
            "temperature_limit=70"
        )
    return name, count


def _show(
    servo: LooseServo,
    values: Mapping[str, int],
    command: ShowTable | ReadRegisters | WriteRegisters,
) -> None:
    write_json({name: _describe(servo, name, count) for name, count in values.items()}, command)
    console: Console = console_for(command)
    console.print(f"[bold]{servo.name}[/], firmware {servo.firmware}")
    table = make_table(
        ("register", "address", "bytes", "counts", "value", "range", "kept"),
        left=("register", "value", "kept"),
    )
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
    console.print(table)


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


def _describe_gauge(gauge: Gauge, baud: int) -> ListedServo:
    servo = gauge.servo
    return ListedServo(
        id=servo.id,
        model=servo.table.model,
        firmware=servo.firmware,
        baud=baud,
        values=gauge.values,
    )
