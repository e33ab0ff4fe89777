"""`getup servo move`: guarded motion of one servo."""

from __future__ import annotations

import math

from rich.markup import escape

from drivers.control_loop import Ending, engaged, run_engaged
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.requests import GroupLayout
from drivers.safety_guard import SafetyGuard
from drivers.service.moved_servo import (
    Move,
    MoveController,
    check_target,
    find_bench,
    make_driver,
)
from drivers.terminal_keys import StopKey
from humanoid_getup.cli.options.servo import MoveServo
from humanoid_getup.cli.robot.servo.registers import NOT_WRITTEN
from humanoid_getup.commands.console import console_for, phase
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.commands.inputs import choose_joints, name_ports
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.prompt import is_confirmed
from robots import Robot, TorqueLimit, load_robot
from robots.bus_settings import MAIN_PORT

CLOSE = math.radians(3.0)  # to its target, where a servo has arrived
SHARE_OF_STALL = 0.5  # torque without a limit
SETTLE_TIME = 0.4  # s at the target before it is measured there
TIMEOUT_MARGIN = 5.0  # s


def move(command: MoveServo) -> int:
    """Move a servo; 0 if it arrives."""
    console = console_for(command)
    if command.robot:
        with refusing():
            robot: Robot = load_robot(command.robot)
        ports, question = name_ports(robot, command.port), ""
    else:
        (path,) = command.port
        with phase("searching"):
            robot, changes = find_bench(path, command.id, command.baud, command.protocol)
        ports, name = {MAIN_PORT: path}, name_of(robot.joints[0])
        kept = ", ".join(f"{register} = {value}" for register, value in changes.items())
        question = f"{name} keeps {kept} without power: write?" if kept else ""
    wanted = _choose_move(command, robot)
    if question and not is_confirmed(console, question, yes=command.yes):
        console.print(f"{NOT_WRITTEN}, nothing moved")
        return DID_NOT_STAND
    driver = make_driver(robot, ports)
    guard = SafetyGuard(driver)
    with StopKey(guard.stop), engaged(guard, realtime=True):
        for warning in driver.diagnostics.warnings:
            console.print(f"[yellow]![/] {escape(str(warning))}")
        controller = MoveController(robot, wanted, guard.read())
        longest = controller.duration + TIMEOUT_MARGIN
        report = run_engaged(controller, guard, max_time=longest, realtime=True)
    start, reached = math.degrees(controller.start), math.degrees(controller.angle)
    joint = robot.joints[wanted.joint]
    is_estimated = not GroupLayout.of(table_named(joint.servo.model.name)).measures_current
    has_arrived = report.ending is Ending.DONE and abs(controller.target - controller.angle) < CLOSE
    result = {
        "joint": joint.name,
        "id": joint.servo.id,
        "start_deg": start,
        "wanted_deg": math.degrees(controller.target),
        "reached_deg": reached,
        "peak_current_a": controller.peak_current,
        "current_is_estimated": is_estimated,
        "moved": has_arrived,
        "reason": report.reason,
    }
    write_json(result, command)
    if report.ending is not Ending.DONE:
        console.print(f"[bold red]stopped[/]: {report.reason}; torque is off")
        return HARDWARE_FAULT
    peak = f"{controller.peak_current:.2f} A"
    console.print(
        f"{name_of(joint)}: {start:+.1f}° to {reached:+.1f}° of "
        f"{result['wanted_deg']:+.1f}°, up to "
        f"{f'~{peak} (estimated from the load)' if is_estimated else peak}; torque is off"
    )
    return DID_IT if has_arrived else DID_NOT_STAND


def _choose_move(command: MoveServo, robot: Robot) -> Move:
    """Choose the joint of a command, and how it moves; check what is known before it is read."""
    with refusing():
        TorqueLimit(command.torque_limit).on(robot)
    joint, *_ = choose_joints(robot, [command.joint] if command.joint else ())
    if command.to is not None:
        check_target(robot, joint, math.radians(command.to))
    most = float(robot.max_torque[joint])
    return Move(
        joint=joint,
        target=math.radians(command.to if command.to is not None else command.by or 0.0),
        is_relative=command.to is None,
        speed=math.radians(command.speed),
        torque_limit=min(most, command.torque_limit or SHARE_OF_STALL * most),
        hold=max(command.hold, SETTLE_TIME),
    )
