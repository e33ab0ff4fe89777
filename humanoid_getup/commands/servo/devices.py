"""`getup servo list`, `monitor`: serial ports, the devices on them, and what they measure."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from tyro.conf import arg

from drivers.dynamixel.control_table import ControlTable
from drivers.dynamixel.diagnostics import read_items
from drivers.serial_port import PortError, SerialPort
from drivers.service import scan
from drivers.service.loose_servo import LooseServo, find_servos, open_bus
from drivers.service.scan import COMMON_RATES, MEASURED, PortFacts, PortScan
from drivers.service.sweep import choose_wires
from drivers.state import HardwareError
from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, count_of, make_table, phase
from humanoid_getup.commands.errors import DID_IT, HARDWARE_FAULT
from humanoid_getup.commands.prompt import QuitKey
from humanoid_getup.commands.servo.registers import ID, AnyPortOptions, Baud, ServoOptions
from robots.bus_settings import BAUD_RATES
from robots.storage.validation import between

HEADINGS = ("mode", "torque", "°", "°/s", "load", "V", "°C", "error")
LEFT = ("model", "mode", "torque", "error")
UNKNOWN = "-"
PLUG_IN = "plug the adapter in (lsusb, dmesg), or name a port with --port"
NO_DEVICE = (
    "no device answers: check power switch and supply, the cable, the servos' baud rate "
    "(--all-bauds), and that no other program uses the port"
)
ONLY_BOARDS = (
    "only a board answers: the servos may have no power until it is switched on there, "
    "as getup doctor does"
)
DOUBLED = (
    "replies are garbled, as by two devices of one id; unplug one at a time and give each its own "
    "id"
)
ONLY_PINGS = (
    "replies to pings alone, as at status return level 0; connecting to its robot sets that to 2"
)
PERIOD = 0.1  # s between two reads of all servos
HINT = "nothing is changed: turn servos without torque by hand from end to end; q ends it"


@dataclass(frozen=True, kw_only=True)
class ListServos(AnyPortOptions):
    """List serial ports and the devices on them with what they measure; changes nothing.

    Without a port all USB adapters are searched, and the I2C buses for IMUs.
    """

    baud: Baud = None
    """Baud rate [bit/s]; default: 57600 and 1, 2, 3 and 4 Mbit/s."""
    all_bauds: bool = False
    """Try every baud rate that a servo may have: ten seconds a port."""


@program("servo list")
def list_servos(options: ListServos) -> int:
    """List ports and devices; 0 if a device answers, 3 if none does."""
    if options.baud is not None and options.all_bauds:
        raise ValueError("--baud and --all-bauds exclude each other, expected one of them")
    ports = () if options.port else scan.list_serial_ports()
    scans = _scan_all(options, ports)
    imus = [] if options.port else scan.find_imus(scan.list_i2c_buses())
    found = [device for each in scans for device in each.found]
    advice = None
    if not found:
        missing = "USB adapter" if ports else "serial port"
        advice = NO_DEVICE if scans else f"no {missing}: {PLUG_IN}"
    elif all(device.is_board for device in found):
        advice = ONLY_BOARDS
    record = {
        "ports": [asdict(port) for port in ports],
        "scans": [_describe(each) for each in scans],
        "imus": [asdict(imu) for imu in imus],
        "advice": advice,
    }
    write_json(record, options)
    console, scanned = console_for(options), {each.path for each in scans}
    for port in ports:
        timer = "" if port.latency_timer is None else f", latency timer {port.latency_timer} ms"
        note = "" if port.path in scanned else " (not scanned: name it with --port)"
        console.print(f"[bold]{escape(port.path)}[/]  [dim]{escape(port.description)}{timer}{note}")
    for each in scans:
        _print_scan(each, console)
    for imu in imus:
        console.print(f"[bold]{escape(imu.path)}[/]: IMU {imu.model}, describe it in \\[imu]")
    if advice:
        console.print(f"[bold]{advice}")
    return DID_IT if found else HARDWARE_FAULT


def _scan_all(options: ListServos, ports: Sequence[PortFacts]) -> list[PortScan]:
    """Scan the port that is named, or all adapters; of these one that refuses stops nothing."""
    rates = BAUD_RATES if options.all_bauds else COMMON_RATES
    if options.baud is not None:
        scan.check_rate(options.baud)
        rates = (options.baud,)
    adapters = [port.path for port in ports if port.is_adapter]
    scans, wires = [], choose_wires(options.protocol)
    with phase("scanning") as report:
        for path in [options.port] if options.port else adapters:
            report(f"scanning {path}")
            try:
                scans.append(scan.scan_port(SerialPort(path, rates[0]), rates, wires))
            except PortError as error:
                if options.port:
                    raise
                scans.append(PortScan(path=path, refusal=str(error)))
    return scans


def _describe(port: PortScan) -> dict[str, Any]:
    """Describe a scan for JSON, what devices measure in SI units."""
    devices = []
    for device in port.found:
        names = ("id", "baud", "number", "model", "firmware", "is_board", "protocol")
        row = {name: getattr(device, name) for name in (*names, "doubled", "only_pings")}
        table, counts = device.table, device.values.items()
        values = {name: table.to_si(name, n) for name, n in counts} if table else {}
        devices.append(row | {"values": values})
    kept = ("path", "rates", "refused_rates", "refusal")
    return {name: getattr(port, name) for name in kept} | {"found": devices}


def _print_scan(port: PortScan, console: Console) -> None:
    if port.refusal is not None:
        console.print(f" [yellow]![/] {escape(port.refusal)}")
        return
    rates = ", ".join(map(str, port.rates))
    number = count_of(len(port.found), "device") if port.found else "no device"
    console.print(f"[bold]{escape(port.path)}[/]: {number} at {rates} bit/s")
    if port.refused_rates:
        refused = ", ".join(map(str, port.refused_rates))
        console.print(f" [yellow]![/] its adapter does not support {refused} bit/s")
    table = make_table(("id", "baud", "model", "fw", *HEADINGS), left=LEFT)
    for device in port.found:
        unknown = "?" if device.number is None else f"unknown model {device.number}"
        firmware = "?" if device.firmware is None else str(device.firmware)
        cells = list_cells(device.table, device.values)
        table.add_row(str(device.id), str(device.baud), device.model or unknown, firmware, *cells)
    if port.found:
        console.print(table)
    for device in port.found:
        at = f"id {device.id} at {device.baud} bit/s"
        if device.doubled:
            console.print(f" [red]✗[/] {at}: {DOUBLED}")
        if device.only_pings:
            console.print(f" [yellow]![/] {at}: {ONLY_PINGS}")


def list_cells(table: ControlTable | None, values: Mapping[str, int]) -> list[str]:
    """List the cells of a device from the counts of its registers; "-" for what it lacks."""
    if table is None:
        return [UNKNOWN] * len(HEADINGS)

    def write(register: str, form: str, factor: float = 1.0) -> str:
        if register not in values:
            return UNKNOWN
        return f"{table.to_si(register, values[register]) * factor + 0.0:{form}}"

    mode, torque = values.get("operating_mode"), values.get("torque_enable")
    error = HardwareError(table.name_errors(values.get("hardware_error_status", 0)))
    has_sensor = "present_current" in values  # of its current; the others estimate a load
    return [
        UNKNOWN if mode is None else table.name_mode(mode),
        {None: UNKNOWN, 0: "off"}.get(torque, "[bold red]on[/]"),
        write("present_position", "+.1f", math.degrees(1.0)),
        write("present_velocity", "+.0f", math.degrees(1.0)),
        f"{write('present_current', '.2f')} A" if has_sensor else write("present_load", ".0%"),
        write("present_input_voltage", ".1f"),
        write("present_temperature", ".0f"),
        f"[red]{error.describe()}[/]" if error else "",
    ]


# Servos that are turned by hand -------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class MonitorServos(ServoOptions):
    """Show what servos measure, and the range that each has been through; changes nothing.

    Turn each servo by hand from end to end: --json keeps the ranges. q ends it.
    """

    id: Annotated[tuple[int, ...], ID, arg(metavar="ID,...")] = ()
    """Ids of the servos; default: all that reply."""
    seconds: Annotated[float | None, between(0.1, 1e6, "s"), arg(metavar="S")] = None
    """Time after which it ends [s]; default: when q is pressed."""


@dataclass
class Gauge:
    """What was read of a servo."""

    servo: LooseServo
    values: dict[str, int] = field(default_factory=dict)
    """Newest values of its registers [counts]; empty before the first reply."""
    seen: tuple[int, ...] = ()
    """Lowest and highest position so far [ticks]; empty before the first reply."""
    is_silent: bool = False
    """Whether the last read got no reply."""

    def read(self) -> None:
        """Read the servo once."""
        values = read_items(self.servo.bus, self.servo.id, self.servo.table, MEASURED)
        self.is_silent = values is None
        if values is not None:
            self.values, ticks = values, (*self.seen, values["present_position"])
            self.seen = (min(ticks), max(ticks))


@program("servo monitor")
def monitor(options: MonitorServos) -> int:
    """Show servos until a person ends it or the time is up; 3 if one is silent at the end."""
    console, key = console_for(options), QuitKey()
    if options.seconds is None and not key.has_terminal:
        raise ValueError("standard input is not a terminal: --seconds is missing")
    rates = COMMON_RATES if options.baud is None else (options.baud,)
    with open_bus(options.port or "", rates[0], options.protocol) as bus, key:
        gauges = [Gauge(servo) for servo in find_servos(bus, rates, options.id)]
        until = math.inf if options.seconds is None else time.monotonic() + options.seconds

        def draw() -> Group:
            return Group(f"[dim]{HINT}", _tabulate(gauges))

        live = Live(console=console, get_renderable=draw, transient=True)
        with live if console.is_terminal else threading.Lock():
            while not key.is_pressed() and time.monotonic() < until:
                for gauge in gauges:
                    gauge.read()
                key.wait(PERIOD)
    ranges = {}
    for gauge in gauges:
        lowest, highest = gauge.seen or (None, None)
        row = {"model": gauge.servo.table.model, "range_min": lowest, "range_max": highest}
        ranges[str(gauge.servo.id)] = row | {"position": gauge.values.get("present_position")}
    write_json(ranges, options)
    console.print(_tabulate(gauges))
    return HARDWARE_FAULT if any(gauge.is_silent for gauge in gauges) else DID_IT


def _tabulate(gauges: Sequence[Gauge]) -> Table:
    table = make_table(("id", "model", *HEADINGS, "seen °", "remark"), left=(*LEFT, "remark"))
    for gauge in gauges:
        kind = gauge.servo.table
        ends = [math.degrees(kind.to_si("present_position", ticks)) for ticks in gauge.seen]
        seen = " to ".join(f"{end:+.0f}" for end in ends) or UNKNOWN
        remark = "[yellow]silent[/]" if gauge.is_silent else ""
        cells = list_cells(kind, gauge.values)
        table.add_row(str(gauge.servo.id), kind.model, *cells, seen, remark)
    return table
