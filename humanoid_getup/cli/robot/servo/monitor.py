"""`getup servo monitor`: a live table of what servos measure, and their ranges."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from rich.console import Group
from rich.live import Live
from rich.table import Table

from drivers.dynamixel.diagnostics import read_items
from drivers.service.loose_servo import LooseServo, find_servos, open_bus
from drivers.service.scan import COMMON_RATES, MEASURED
from humanoid_getup.cli.options.servo import MonitorServos
from humanoid_getup.cli.robot.servo.measurements import HEADINGS, LEFT, UNKNOWN, list_cells
from humanoid_getup.cli.robot.watch import QuitKey
from humanoid_getup.commands.console import console_for, make_table
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.commands.output import write_json

PERIOD = 0.1  # s between two reads of all servos
HINT = "nothing is changed: turn servos without torque by hand from end to end; q ends it"


@dataclass
class Gauge:
    """What was read of a servo."""

    servo: LooseServo
    values: dict[str, int] = field(default_factory=dict)
    """Newest values of its registers [counts]; empty before the first reply."""
    range_min: int | None = None
    """Lowest position so far [ticks]; None before the first reply."""
    range_max: int | None = None
    is_silent: bool = False
    """Whether the last read got no reply."""

    def read(self) -> None:
        """Read the servo once.

        Raises:
            PortLostError: if the port is gone.
        """
        values = read_items(self.servo.bus, self.servo.id, self.servo.table, MEASURED)
        self.is_silent = values is None
        if values is None:
            return
        position, self.values = values["present_position"], values
        self.range_min = position if self.range_min is None else min(self.range_min, position)
        self.range_max = position if self.range_max is None else max(self.range_max, position)

    def describe_range(self) -> dict[str, str | int | None]:
        """Describe the range that it has been through [ticks], for JSON."""
        return {
            "model": self.servo.table.model,
            "range_min": self.range_min,
            "range_max": self.range_max,
            "position": self.values.get("present_position"),
        }


def monitor(command: MonitorServos) -> int:
    """Show servos until a person ends it or the time is up; 3 if one is silent at the end."""
    console, key = console_for(command), QuitKey()
    if command.seconds is None and not key.has_terminal:
        raise BadInputError("standard input is not a terminal: --seconds is missing")
    rates = COMMON_RATES if command.baud is None else (command.baud,)
    with open_bus(command.path, rates[0], command.protocol) as bus, key:
        gauges = [Gauge(servo) for servo in find_servos(bus, rates, command.id)]
        until = math.inf if command.seconds is None else time.monotonic() + command.seconds
        live = Live(console=console, get_renderable=lambda: _draw(gauges), transient=True)
        with live if console.is_terminal else threading.Lock():
            while not key.is_pressed() and time.monotonic() < until:
                for gauge in gauges:
                    gauge.read()
                key.wait(PERIOD)
    ranges = {str(gauge.servo.id): gauge.describe_range() for gauge in gauges}
    write_json(ranges, command)
    console.print(_tabulate(gauges))
    return HARDWARE_FAULT if any(gauge.is_silent for gauge in gauges) else DID_IT


def _draw(gauges: Sequence[Gauge]) -> Group:
    return Group(f"[dim]{HINT}", _tabulate(gauges))


def _tabulate(gauges: Sequence[Gauge]) -> Table:
    table = make_table(("id", "model", *HEADINGS, "seen °", "remark"), left=(*LEFT, "remark"))
    for gauge in gauges:
        servo, seen = gauge.servo, UNKNOWN
        if gauge.range_min is not None and gauge.range_max is not None:
            ends = [
                math.degrees(servo.table.to_si("present_position", ticks))
                for ticks in (gauge.range_min, gauge.range_max)
            ]
            seen = f"{ends[0]:+.0f} to {ends[1]:+.0f}"
        cells = list_cells(servo.table, gauge.values)
        remark = "[yellow]silent[/]" if gauge.is_silent else ""
        table.add_row(str(servo.id), servo.table.model, *cells, seen, remark)
    return table
