"""`getup scan`: lists serial ports and the devices on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drivers.serial_port import PortError, SerialPort
from drivers.service.imu_scan import FoundImu, find_imus, list_i2c_buses
from drivers.service.scan import (
    COMMON_RATES,
    FoundDevice,
    PortFacts,
    PortScan,
    check_rate,
    list_serial_ports,
    scan_port,
)
from humanoid_getup.cli.options.hardware import Scan
from humanoid_getup.cli.shared.console import console_for, make_table, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import refusing
from robots.bus_settings import BAUD_RATES

NO_PORT = "no serial port: plug the adapter in (lsusb, dmesg), or name a port with --port"
NO_DEVICE = (
    "no device answers: check the robot's power switch and battery, the cable, the servos' baud "
    "rate (--all-bauds), and that no other program uses the port"
)
ONLY_BOARDS = (
    "only a board answers: the servos may have no power until it is switched on there, "
    "as getup doctor does"
)


def scan(command: Scan) -> int:
    """Scan the ports; 0 if a device answers, 3 if none does."""
    rates = _choose_rates(command)
    ports = list_serial_ports()
    with phase("scanning") as report:
        scans = _scan_all(command.port, ports, rates, report)
        imus = find_imus(list_i2c_buses()) if command.port is None else []
    found = [device for scan in scans for device in scan.found]
    advice = _advise(scans, found)
    record = {
        "ports": [asdict(port) for port in ports],
        "scans": [asdict(scan) for scan in scans],
        "imus": [asdict(imu) for imu in imus],
        "advice": advice,
    }
    write_json(record, command)
    console = console_for(command)
    _print(ports if command.port is None else (), scans, advice, console)
    _print_imus(imus, console)
    return DID_IT if found else HARDWARE_FAULT


def _choose_rates(command: Scan) -> tuple[int, ...]:
    """Return the baud rates to try [bit/s]."""
    if command.baud is None:
        return BAUD_RATES if command.all_bauds else COMMON_RATES
    with refusing():
        check_rate(command.baud)
    return (command.baud,)


def _scan_all(
    path: str | None,
    ports: Sequence[PortFacts],
    rates: tuple[int, ...],
    report: Callable[[str], None],
) -> list[PortScan]:
    if path is not None:
        report(f"scanning {path}")
        return [scan_port(SerialPort(path, rates[0]), rates)]
    scans = []
    for port in ports:
        if not port.is_adapter:
            continue
        report(f"scanning {port.path}")
        try:
            scans.append(scan_port(SerialPort(port.path, rates[0]), rates))
        except PortError as error:  # the next one may be the robot's
            scans.append(PortScan(path=port.path, refusal=str(error)))
    return scans


def _advise(scans: Sequence[PortScan], found: Sequence[FoundDevice]) -> str | None:
    if found:
        return ONLY_BOARDS if all(device.is_board for device in found) else None
    return NO_DEVICE if scans else NO_PORT


def _print(
    ports: Sequence[PortFacts], scans: Sequence[PortScan], advice: str | None, console: Console
) -> None:
    scanned = {scan.path for scan in scans}
    for port in ports:
        timer = "" if port.latency_timer is None else f", latency timer {port.latency_timer} ms"
        note = "" if port.path in scanned else " (not scanned: name it with --port)"
        console.print(f"[bold]{escape(port.path)}[/]  [dim]{escape(port.description)}{timer}{note}")
    for scan in scans:
        if scan.refusal is not None:
            console.print(f" [yellow]![/] {escape(scan.refusal)}", markup=True)
            continue
        rates = ", ".join(map(str, scan.rates))
        console.print(f"[bold]{escape(scan.path)}[/]: {_count(scan.found)} at {rates} bit/s")
        if scan.refused_rates:
            refused = ", ".join(map(str, scan.refused_rates))
            console.print(f" [yellow]![/] its adapter does not support {refused} bit/s")
        if scan.found:
            console.print(_tabulate(scan.found))
        for device in scan.found:
            if device.doubled:
                console.print(
                    f" [red]✗[/] id {device.id} at {device.baud} bit/s: replies are garbled, as "
                    "by two devices of one id; unplug one at a time and give each its own id"
                )
            if device.only_pings:
                console.print(
                    f" [yellow]![/] id {device.id} at {device.baud} bit/s: replies to pings alone, "
                    "as at status return level 0; connecting to its robot sets that to 2"
                )
    if advice:
        console.print(f"[bold]{advice}")


def _print_imus(imus: Sequence[FoundImu], console: Console) -> None:
    for imu in imus:
        console.print(f"[bold]{escape(imu.path)}[/]: IMU {imu.model}, describe it in \\[imu]")


def _count(found: Sequence[FoundDevice]) -> str:
    n = len(found)
    return "no device" if not n else "1 device" if n == 1 else f"{n} devices"


def _tabulate(found: Sequence[FoundDevice]) -> Table:
    table = make_table(("id", "baud", "model", "firmware", "V", "°C"), left=["model"])
    for device in found:
        unknown = "?" if device.number is None else f"unknown model {device.number}"
        table.add_row(
            str(device.id),
            str(device.baud),
            device.model or unknown,
            _show(device.firmware, ""),
            _show(device.voltage, ".1f"),
            _show(device.temperature, ".0f"),
        )
    return table


def _show(value: float | None, form: str) -> str:
    return "?" if value is None else f"{value:{form}}"
