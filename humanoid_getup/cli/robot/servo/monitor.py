"""`getup servo monitor`: a live table and plot of what servos measure."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

from rich.console import Group
from rich.live import Live
from rich.markup import escape

from drivers.service.scan import COMMON_RATES
from drivers.service.servos.found_bench import find_all
from drivers.service.servos.gauges import Gauge, Gauges
from drivers.service.servos.loose_servo import open_bus
from humanoid_getup.cli.options.servo import MonitorServos
from humanoid_getup.cli.robot.servo.registers import tabulate_gauges
from humanoid_getup.cli.robot.watch import QuitKey
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import BadInputError
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

PERIOD = 0.1  # s between two reads of all servos
BARS = "▁▂▃▄▅▆▇█"
HINT = "nothing is changed: turn servos without torque by hand from end to end; q ends it"


@dataclass(frozen=True, kw_only=True)
class SeenRange:
    """Range that a servo has been through [ticks], for JSON; None before its first reply."""

    model: str
    range_min: int | None
    range_max: int | None
    position: int | None
    """Newest one."""


def monitor(command: MonitorServos) -> int:
    """Show servos until a person ends it or the time is up; 3 if one is silent at the end."""
    console, key = console_for(command), QuitKey()
    if command.seconds is None and not key.has_terminal:
        raise BadInputError("standard input is not a terminal: --seconds is missing")
    rates = COMMON_RATES if command.baud is None else (command.baud,)
    with open_bus(command.path, rates[0], command.protocol) as bus, key:
        gauges = Gauges(bus, find_all(bus, command.id, rates))
        until = None if command.seconds is None else time.monotonic() + command.seconds
        live = Live(console=console, get_renderable=lambda: _draw(gauges), transient=True)
        with live if console.is_terminal else threading.Lock():
            while not key.is_pressed() and (until is None or time.monotonic() < until):
                gauges.read()
                key.wait(PERIOD)
    ranges = {str(gauge.servo.id): describe_range(gauge) for gauge in gauges.all}
    if command.save is not None:
        write_atomically(command.save, to_json(ranges))
    write_json(ranges, command)
    console.print(tabulate_gauges(gauges.all))
    if command.save is not None:
        console.print(f"ranges are saved in [bold]{escape(str(command.save))}[/]")
    return HARDWARE_FAULT if any(gauge.missed for gauge in gauges.all) else DID_IT


def describe_range(gauge: Gauge) -> SeenRange:
    """Describe the range that a servo has been through."""
    return SeenRange(
        model=gauge.servo.table.model,
        range_min=gauge.lowest,
        range_max=gauge.highest,
        position=gauge.positions[-1] if gauge.positions else None,
    )


def _draw(gauges: Gauges) -> Group:
    plots = (f"id {gauge.servo.id:3d} {draw_bars(list(gauge.positions))}" for gauge in gauges.all)
    return Group(f"[dim]{HINT}", tabulate_gauges(gauges.all), *plots)


def draw_bars(values: list[int]) -> str:
    """Draw values as a line of bars between the least and the largest."""
    if not values:
        return ""
    least, span = min(values), max(values) - min(values)
    if not span:
        return BARS[0] * len(values)
    return "".join(BARS[(value - least) * (len(BARS) - 1) // span] for value in values)
