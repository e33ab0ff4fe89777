"""`getup servo list`: serial ports and the devices on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drivers.serial_port import PortError, SerialPort
from drivers.service.scan import (
    COMMON_RATES,
    FoundDevice,
    PortFacts,
    PortScan,
    check_rate,
    find_imus,
    list_i2c_buses,
    list_serial_ports,
    scan_port,
)
from drivers.service.sweep import choose_wires
from humanoid_getup.cli.options.servo import ListServos
from humanoid_getup.cli.robot.servo.measurements import HEADINGS, LEFT, list_cells
from humanoid_getup.commands.console import console_for, count_of, make_table, phase
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.commands.output import write_json
from robots.bus_settings import BAUD_RATES

NO_PORT = "no serial port: plug the adapter in (lsusb, dmesg), or name a port with --port"
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


def list_servos(command: ListServos) -> int:
    """List ports and devices; 0 if a device answers, 3 if none does."""
    ports = () if command.port else list_serial_ports()
    with phase("scanning") as report:
        scans = _scan_all(command, ports, report)
        imus = [] if command.port else find_imus(list_i2c_buses())
    found = [device for scan in scans for device in scan.found]
    advice = _advise(scans, found)
    record = {
        "ports": [asdict(port) for port in ports],
        "scans": [_describe(scan) for scan in scans],
        "imus": [asdict(imu) for imu in imus],
        "advice": advice,
    }
    write_json(record, command)
    console = console_for(command)
    _print_ports(ports, scans, console)
    for scan in scans:
        _print_scan(scan, console)
    for imu in imus:
        console.print(f"[bold]{escape(imu.path)}[/]: IMU {imu.model}, describe it in \\[imu]")
    if advice:
        console.print(f"[bold]{advice}")
    return DID_IT if found else HARDWARE_FAULT


def _scan_all(
    command: ListServos, ports: Sequence[PortFacts], report: Callable[[str], None]
) -> list[PortScan]:
    """Scan the port of a command, or all adapters; of these one that refuses stops nothing."""
    rates = BAUD_RATES if command.all_bauds else COMMON_RATES
    if command.baud is not None:
        with refusing():
            check_rate(command.baud)
        rates = (command.baud,)
    wires = choose_wires(command.protocol)
    if command.port:
        report(f"scanning {command.port}")
        return [scan_port(SerialPort(command.port, rates[0]), rates, wires)]
    scans = []
    for path in (port.path for port in ports if port.is_adapter):
        report(f"scanning {path}")
        try:
            scans.append(scan_port(SerialPort(path, rates[0]), rates, wires))
        except PortError as error:  # the next one may be the robot's
            scans.append(PortScan(path=path, refusal=str(error)))
    return scans


def _advise(scans: Sequence[PortScan], found: Sequence[FoundDevice]) -> str | None:
    if found:
        return ONLY_BOARDS if all(device.is_board for device in found) else None
    return NO_DEVICE if scans else NO_PORT


def _describe(scan: PortScan) -> dict[str, Any]:
    """Describe a scan for JSON, what devices measure in SI units."""
    devices = []
    for device in scan.found:
        table, names = device.table, ("id", "baud", "number", "model", "firmware", "is_board")
        row = {name: getattr(device, name) for name in (*names, "protocol", *FLAGS)}
        values = {name: table.to_si(name, n) for name, n in device.values.items()} if table else {}
        devices.append(row | {"values": values})
    kept = ("path", "rates", "refused_rates", "refusal")
    return {name: getattr(scan, name) for name in kept} | {"found": devices}


FLAGS = ("doubled", "only_pings")


def _print_ports(ports: Sequence[PortFacts], scans: Sequence[PortScan], console: Console) -> None:
    scanned = {scan.path for scan in scans}
    for port in ports:
        timer = "" if port.latency_timer is None else f", latency timer {port.latency_timer} ms"
        note = "" if port.path in scanned else " (not scanned: name it with --port)"
        console.print(f"[bold]{escape(port.path)}[/]  [dim]{escape(port.description)}{timer}{note}")


def _print_scan(scan: PortScan, console: Console) -> None:
    if scan.refusal is not None:
        console.print(f" [yellow]![/] {escape(scan.refusal)}")
        return
    rates = ", ".join(map(str, scan.rates))
    number = count_of(len(scan.found), "device") if scan.found else "no device"
    console.print(f"[bold]{escape(scan.path)}[/]: {number} at {rates} bit/s")
    if scan.refused_rates:
        refused = ", ".join(map(str, scan.refused_rates))
        console.print(f" [yellow]![/] its adapter does not support {refused} bit/s")
    if scan.found:
        console.print(_tabulate(scan.found))
    for device in scan.found:
        at = f"id {device.id} at {device.baud} bit/s"
        if device.doubled:
            console.print(f" [red]✗[/] {at}: {DOUBLED}")
        if device.only_pings:
            console.print(f" [yellow]![/] {at}: {ONLY_PINGS}")


def _tabulate(found: Sequence[FoundDevice]) -> Table:
    table = make_table(("id", "baud", "model", "fw", *HEADINGS), left=LEFT)
    for device in found:
        unknown = "?" if device.number is None else f"unknown model {device.number}"
        table.add_row(
            str(device.id),
            str(device.baud),
            device.model or unknown,
            "?" if device.firmware is None else str(device.firmware),
            *list_cells(device.table, device.values),
        )
    return table
