"""`getup doctor`: whether a robot on its bus is fit for torque, and what to do if not."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from tyro.conf import arg

from drivers.dynamixel.backend import READ_SHARE
from drivers.dynamixel.control_table import HardwareError, OperatingMode
from drivers.dynamixel.diagnostics import ServoFacts, Severity
from drivers.service.doctor import HealthCheck, LineReport, examine
from drivers.service.session import open_robot_bus
from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.cli.options import RobotOption
from humanoid_getup.cli.output import console_for, find_json_faults, to_json, write_json
from humanoid_getup.cli.ports import find_port_faults, name_ports

NOTHING_SET = "only looked: no torque was switched, nothing was set that a servo keeps"
HEADINGS = ("joint", "id", "model", "fw", "°C", "V", "angle °", "range °", "delay µs", "mode")


@dataclass(frozen=True, kw_only=True)
class Doctor(RobotOption):
    """Look at a robot on its bus before first torque; moves nothing."""

    port: Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH")] = ()
    """Serial port; of a robot with several, one NAME=PATH each."""
    json: Annotated[str | None, arg(metavar="FILE|-")] = None
    """Write the figures to a file; - prints them alone on standard output."""

    def run(self) -> int:
        """Look, judge, tell; 0 when the robot is healthy, 3 when it must not move like this."""
        faults = find_json_faults(self.json) + find_port_faults(None, self.port)
        if faults:
            raise BadInputError("; ".join(faults))
        robot = self.load_robot()
        ports = name_ports(robot, self.port)
        with Console(stderr=True).status("looking"), open_robot_bus(robot, ports) as bus:
            checkup = examine(bus)
        write_json(to_json(record_checkup(checkup)), self.json)
        print_checkup(checkup, console_for(self.json))
        return HARDWARE_FAULT if checkup.errors else DID_IT


# For machines -------------------------------------------------------------------------------


def record_checkup(checkup: HealthCheck) -> dict[str, Any]:
    """Return a checkup as plain values, for JSON."""
    return {
        "robot": checkup.robot.name,
        "healthy": not checkup.errors,
        "findings": [
            {
                "severity": finding.severity.value,
                "device": finding.device,
                "text": finding.text,
                "remedy": finding.remedy,
            }
            for finding in checkup.findings
        ],
        "written": checkup.written,
        "calibrated": checkup.is_calibrated,
        "torque_on": [joint.name for joint in checkup.torque],
        "period_s": checkup.robot.control_period,
        "reading_allowed_s": READ_SHARE * checkup.robot.control_period,
        "ports": [asdict(line) for line in checkup.lines],
        "accelerometer_m_s2": checkup.imu and checkup.imu.accelerometer,
        "gyro_rad_s": checkup.imu and checkup.imu.gyro,
        "joints": {servo.joint.name: _record_servo(servo) for servo in checkup.servos},
    }


def _record_servo(servo: ServoFacts) -> dict[str, Any]:
    told = servo.registers
    return {
        "id": servo.id,
        "model": servo.table.model,
        "firmware": servo.firmware,
        "temperature_c": servo.temperature,
        "voltage_v": servo.voltage,
        "angle_rad": servo.angle,
        "ticks": told["present_position"],
        "lower_rad": servo.joint.lower,
        "upper_rad": servo.joint.upper,
        "return_delay_s": told["return_delay_time"] * servo.table["return_delay_time"].scale,
        "operating_mode": told["operating_mode"],
        "torque_on": bool(told["torque_enable"]),
        "hardware_error": told["hardware_error_status"],
    }


# For people ---------------------------------------------------------------------------------


def print_checkup(checkup: HealthCheck, console: Console) -> None:
    """Tell a person what was found, what to do about it, and all figures."""
    name, errors, warnings = checkup.robot.name, len(checkup.errors), len(checkup.warnings)
    told = f"{errors} errors, {warnings} warnings" if errors else f"healthy, {warnings} warnings"
    console.print(f"[bold {'red' if errors else 'green'}]{name}: {told}")
    for finding in checkup.findings:
        mark = "[yellow]![/]" if finding.severity is Severity.WARNING else "[red]✗[/]"
        console.print(f" {mark} {escape(str(finding))}")
    if checkup.servos:
        console.print(_tabulate(checkup))
    for line in checkup.lines:
        _print_line(line, checkup, console)
    if checkup.imu is not None:
        x, y, z = checkup.imu.accelerometer
        console.print(f"[bold]IMU[/]: up is ({x:+.1f}, {y:+.1f}, {z:+.1f}) m/s² in its axes")
    calibrated = "present" if checkup.is_calibrated else "none: getup calibrate"
    console.print(f"[bold]calibration[/]: {calibrated}")
    console.print(f"[dim]{escape('; '.join((NOTHING_SET, *checkup.written)))}")


def _tabulate(checkup: HealthCheck) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in (*HEADINGS, "torque", "error"):
        table.add_column(title, justify="left" if title in ("joint", "model") else "right")
    for servo in checkup.servos:
        joint, told = servo.joint, servo.registers
        lower, upper = (round(math.degrees(limit)) for limit in (joint.lower, joint.upper))
        error = HardwareError(told["hardware_error_status"])
        table.add_row(
            joint.name,
            str(servo.id),
            servo.table.model,
            str(servo.firmware),
            f"{servo.temperature:.0f}",
            f"{servo.voltage:.1f}",
            f"{math.degrees(servo.angle):+.1f}",
            f"{lower:+d} to {upper:+d}",
            f"{told['return_delay_time'] * 2}",
            _name_mode(told["operating_mode"]),
            "on" if told["torque_enable"] else "off",
            " ".join(str(bit.name).lower() for bit in error) or "-",
        )
    return table


def _print_line(line: LineReport, checkup: HealthCheck, console: Console) -> None:
    period = checkup.robot.control_period
    allowed = f"{1.0 / period:.0f} Hz needs at most {READ_SHARE * period * 1e3:.1f} ms"
    timer = "" if line.latency_timer is None else f", latency timer {line.latency_timer} ms"
    console.print(f"[bold]port {line.name}[/]: {line.path}, {line.baud} bit/s{timer}")
    latency = line.latency
    if latency is None:
        return
    console.print(
        f"  {latency.kind}: median {latency.group_median * 1e3:.2f} ms, "
        f"p99 {latency.group_p99 * 1e3:.2f} ms, {latency.rounds} times"
    )
    console.print(
        f"  all reading of a cycle: median {latency.reading_median * 1e3:.2f} ms, "
        f"p99 {latency.reading_p99 * 1e3:.2f} ms; {allowed}"
    )
    console.print(
        f"  one cycle: {line.cycle_bytes} bytes, {line.cycle_time * 1e3:.2f} ms on the wire "
        f"of {period * 1e3:.1f} ms"
    )


def _name_mode(mode: int) -> str:
    try:
        return OperatingMode(mode).name.lower().replace("_", " ")
    except ValueError:
        return str(mode)
