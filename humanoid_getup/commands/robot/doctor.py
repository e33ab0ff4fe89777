"""`getup doctor`: checks a robot on its bus before first torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drivers.dynamixel.configuration import OPERATING_MODES
from drivers.dynamixel.diagnostics import READ_SHARE, ServoFacts, Severity
from drivers.real_time_class import IS_KNOWN
from drivers.service.doctor import HealthCheck, PortReport, examine
from drivers.service.session import open_robot_bus
from drivers.state import HardwareError
from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, count_of, make_table, phase
from humanoid_getup.commands.errors import DID_IT, HARDWARE_FAULT
from humanoid_getup.commands.inputs import load_robot, name_ports
from humanoid_getup.commands.options import ServiceOptions
from robots import Joint, Robot

PRIORITIZED = "the control loop goes before other programs"
NOT_PRIORITIZED = "beside other programs more cycles are late"
PERMIT = "not permitted, rtprio 60 in /etc/security/limits.d permits it"
NOTHING_SET = "read only: no torque was switched, no EEPROM was written"
MEASURED = ("°C", "V", "angle °", "range °", "delay µs", "mode", "torque", "error")
HEADINGS = ("joint", "id", "model", "fw", *MEASURED)


@dataclass(frozen=True, kw_only=True)
class Doctor(ServiceOptions):
    """Check a robot on its bus before first torque; moves nothing."""


@program("doctor")
def doctor(command: Doctor) -> int:
    """Check and report; 0 if the robot is healthy, 3 if it must not move."""
    robot = load_robot(command, takes_bench=True)
    ports = name_ports(robot, command.port)
    with phase("checking"), open_robot_bus(robot, ports) as bus:
        health = examine(bus)
    write_json(describe(health), command)
    print_health(health, console_for(command))
    return HARDWARE_FAULT if health.errors else DID_IT


def describe(health: HealthCheck) -> dict[str, Any]:
    """Describe a health check for JSON."""
    robot, imu = health.robot, health.imu
    return {
        "robot": robot.name,
        "healthy": not health.errors,
        "findings": health.findings,
        "written": health.written,
        "calibrated": health.is_calibrated,
        "real_time_class": health.is_prioritized,
        "torque_on": [joint.name for joint in health.torque],
        "limit_by": robot.limit_by,
        "period_s": robot.control_period,
        "reading_allowed_s": READ_SHARE * robot.control_period,
        "ports": health.ports,
        "accelerometer_m_s2": imu and imu.accelerometer,
        "gyro_rad_s": imu and imu.gyro,
        "imu": health.imu_name,
        "imu_rate_hz": health.imu_rate,
        "joints": {servo.joint.name: _describe_servo(servo, robot) for servo in health.servos},
    }


def _describe_servo(servo: ServoFacts, robot: Robot) -> dict[str, Any]:
    registers, joint = servo.registers, _find_joint(servo, robot)
    delay = servo.table["return_delay_time"]
    return {
        "id": servo.id,
        "model": servo.table.model,
        "firmware": servo.firmware,
        "temperature_c": servo.temperature,
        "voltage_v": servo.voltage,
        "angle_rad": servo.angle,
        "ticks": registers["present_position"],
        "lower_rad": joint.lower,
        "upper_rad": joint.upper,
        "return_delay_s": registers["return_delay_time"] * delay.scale,
        "operating_mode": registers.get("operating_mode"),
        "torque_on": bool(registers["torque_enable"]),
        "hardware_error": registers["hardware_error_status"],
    }


def _find_joint(servo: ServoFacts, robot: Robot) -> Joint:
    """Find the joint of a servo, whose own range is another than the servo's where coupled."""
    return robot.joints[robot.joint_names.index(servo.joint.name)]


def print_health(health: HealthCheck, console: Console) -> None:
    """Print findings, remedies and all figures."""
    name, errors, warnings = health.robot.name, len(health.errors), len(health.warnings)
    state = count_of(errors, "error") if errors else "healthy"
    found = f"{name}: {state}, {count_of(warnings, 'warning')}"
    console.print(f"[bold {'red' if errors else 'green'}]{found}")
    for finding in health.findings:
        mark = "[yellow]![/]" if finding.severity is Severity.WARNING else "[red]✗[/]"
        console.print(f" {mark} {escape(str(finding))}")
    if health.servos:
        console.print(_tabulate(health))
    for port in health.ports:
        _print_port(port, health, console)
    if health.imu is not None:
        x, y, z = health.imu.accelerometer
        rate = "" if health.imu_rate is None else f", {health.imu_rate:.0f} samples a second"
        note = f", {health.imu_note}" if health.imu_note else ""
        console.print(
            f"[bold]IMU[/]: up is ({x:+.1f}, {y:+.1f}, {z:+.1f}) m/s² in its axes, "
            f"{escape(health.imu_name)}{rate}{note}"
        )
    mode = OPERATING_MODES[health.robot.limit_by].describe()
    console.print(f"[bold]torque limits[/]: by {health.robot.limit_by}, in {mode} mode")
    permit = f"{PERMIT if IS_KNOWN else 'none on this system'}: {NOT_PRIORITIZED}"
    real_time = PRIORITIZED if health.is_prioritized else permit
    console.print(f"[bold]real-time class[/]: {real_time}")
    console.print(f"[dim]{escape('; '.join((NOTHING_SET, *health.written)))}")


def _tabulate(health: HealthCheck) -> Table:
    table = make_table(HEADINGS, left=("joint", "model"))
    for servo in health.servos:
        joint, registers = _find_joint(servo, health.robot), servo.registers
        lower, upper = (round(math.degrees(limit)) for limit in (joint.lower, joint.upper))
        table.add_row(
            *map(str, (joint.name, servo.id, servo.table.model, servo.firmware)),
            f"{servo.temperature:.0f}",
            f"{servo.voltage:.1f}",
            "-" if servo.angle is None else f"{math.degrees(servo.angle):+.1f}",
            f"{lower:+d} to {upper:+d}",
            f"{registers['return_delay_time'] * 2}",
            servo.mode_name,
            "on" if registers["torque_enable"] else "off",
            " ".join(str(bit.name).lower() for bit in HardwareError(servo.errors)) or "-",
        )
    return table


def _print_port(port: PortReport, health: HealthCheck, console: Console) -> None:
    period = health.robot.control_period
    limit = f"{1.0 / period:.0f} Hz needs at most {READ_SHARE * period * 1e3:.1f} ms"
    timer = "" if port.latency_timer is None else f", latency timer {port.latency_timer} ms"
    console.print(f"[bold]port {port.name}[/]: {port.path}, {port.baud} bit/s{timer}")
    latency = port.latency
    if latency is None:
        return
    console.print(
        f"  {latency.kind}: median {latency.group_median * 1e3:.2f} ms, "
        f"p99 {latency.group_p99 * 1e3:.2f} ms, {latency.rounds} times"
    )
    console.print(
        f"  all reads of a cycle: median {latency.reading_median * 1e3:.2f} ms, "
        f"p99 {latency.reading_p99 * 1e3:.2f} ms; {limit}"
    )
    if latency.return_delays:
        waited = latency.return_delays * 1e3
        console.print(f"  of them {waited:.2f} ms return delays, which the driver sets to 0")
    console.print(
        f"  one cycle: {port.cycle_bytes} bytes, {port.cycle_time * 1e3:.2f} ms on the wire "
        f"of {period * 1e3:.1f} ms"
    )
