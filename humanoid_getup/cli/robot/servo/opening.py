"""What the commands that move servos share: the servos of a command line, and why a run ended."""

from __future__ import annotations

from rich.console import Console

from drivers.control_loop import Ending, RunReport
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import NO_WATCHDOG
from drivers.service.servos.found_bench import find_bench
from drivers.service.servos.guarded_motion import MovedServos, choose_servos
from humanoid_getup.cli.options.servo import MovedOptions
from humanoid_getup.cli.shared.console import phase
from humanoid_getup.cli.shared.prompt import is_confirmed
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import name_ports
from robots import Robot, load_robot
from robots.bus_settings import MAIN_PORT

NOT_WRITTEN = "nothing is written, nothing moved"


def open_servos(command: MovedOptions, console: Console) -> MovedServos | None:
    """Find the servos of a command; None if the person does not agree to what is written."""
    if command.robot:
        robot = load_robot(command.robot)
        ports = name_ports(robot, command.port)
        _warn(robot, console)
        return choose_servos(robot, ports, command.joint, command.torque_limit)
    if len(command.port) != 1:
        raise BadInputError(f"--port is {','.join(command.port)}, expected one serial port")
    (path,) = command.port
    with phase("searching"):
        found = find_bench(path, command.id, command.baud, command.protocol)
    if changes := found.describe_eeprom():
        question = f"servos keep without power: {'; '.join(changes)}; write?"
        if not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return None
    _warn(found.bench, console)
    return choose_servos(found.bench, {MAIN_PORT: path}, (), command.torque_limit)


def _warn(robot: Robot, console: Console) -> None:
    """Say before torque comes on which servos would hold if this program died."""
    ids = [
        joint.servo.id
        for joint in robot.joints
        if not table_named(joint.servo.model.name).has_watchdog
    ]
    if ids:
        text, remedy = NO_WATCHDOG
        console.print(f"[yellow]![/] id {', '.join(map(str, ids))}: {text}; {remedy}")


def print_end(report: RunReport, console: Console) -> None:
    """Print why a run ended, unless it was done."""
    if report.ending is not Ending.DONE:
        console.print(f"[bold red]stopped[/]: {report.reason}; torque is off")
