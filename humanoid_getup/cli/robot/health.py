"""`getup health`: checks the robot of a running program."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.check_health import RobotHealth, check_health
from humanoid_getup.jobs.requests.health import HealthRequest


def health(command: HealthRequest) -> int:
    """Check and report; 0 if the robot is healthy, 3 if not."""
    found = check_health(command)
    write_json(found, command)
    _print(found, console_for(command))
    return DID_IT if found.healthy else HARDWARE_FAULT


def _print(found: RobotHealth, console: Console) -> None:
    state = "[bold green]healthy[/]" if found.healthy else "[bold red]not healthy[/]"
    doing = found.phase or "running"
    console.print(f"[bold]{escape(found.robot)}[/], program {found.program}, {doing}: {state}")
    for finding in found.findings:
        console.print(f" [red]✗[/] {escape(finding)}")
    imu = "" if found.imu_age_s is None else f", IMU {1e3 * found.imu_age_s:.0f} ms"
    rate = "no cycle meanwhile" if not found.rate_hz else f"{found.rate_hz:.0f} Hz"
    console.print(f"rate    {rate} of {found.wanted_hz:.0f} Hz, {found.clips} commands cut so far")
    console.print(f"ages    servos {1e3 * found.read_age_s:.0f} ms{imu}")
    console.print(f"torque  {_describe_torque(found)}")
    console.print(
        f"supply  {found.voltage_v:.1f} V; hottest {found.hottest}, {found.hottest_c:.0f} °C"
    )


def _describe_torque(found: RobotHealth) -> str:
    """Describe the torque limits in force: those of most joints, and the others by name."""
    if not found.torque_on:
        return "off"
    limits = [limit for limit in found.torque_limits_nm.values() if limit > 0.0]
    least, most = min(limits), max(limits)
    between = f"{most:.2f} N·m" if most - least < 0.005 else f"{least:.2f} to {most:.2f} N·m"
    limp = len(found.torque_limits_nm) - len(limits)
    return f"on, limits {between}" + (f"; {limp} joints limp" if limp else "")
