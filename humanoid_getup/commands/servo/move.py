"""`getup servo move`: guarded motion of one servo."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from rich.markup import escape
from tyro.conf import arg

from drivers.control_loop import Ending, engaged, run_engaged
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import name_of
from drivers.dynamixel.requests import GroupLayout
from drivers.safety_guard import SafetyGuard
from drivers.service.moved_servo import Move, MoveController, check_target, find_bench, make_driver
from drivers.terminal_keys import StopKey
from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, phase
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, HARDWARE_FAULT, refusing
from humanoid_getup.commands.files import ROBOT
from humanoid_getup.commands.inputs import choose_joints, name_ports
from humanoid_getup.commands.options import NO_PORT, JsonOption, Ports
from humanoid_getup.commands.prompt import is_confirmed
from humanoid_getup.commands.servo.registers import ID, NOT_WRITTEN, Baud, Protocol
from robots import Robot, TorqueLimit, load_robot
from robots.bus_settings import MAIN_PORT
from robots.storage.validation import between

CLOSE = math.radians(3.0)  # to its target, where a servo has arrived
SHARE_OF_STALL = 0.5  # torque without a limit
SETTLE_TIME = 0.4  # s at the target before it is measured there
TIMEOUT_MARGIN = 5.0  # s
Angle = Annotated[float | None, between(-3600.0, 3600.0, "°"), arg(metavar="°")]


@dataclass(frozen=True, kw_only=True)
class MoveServo(JsonOption):
    """Move a servo slowly, hold it, and switch its torque off; a key stops it.

    With --robot a joint moves, within the range of its description. Without, a servo moves within
    the position limits that are stored in it, and angle 0 is the middle of its turn.
    """

    port: Ports = ()
    """Serial port; of a robot with several, NAME=PATH of each."""
    baud: Baud = None
    """Baud rate of a servo without a robot [bit/s]; default: common ones are tried."""
    protocol: Protocol | None = None
    """What a servo without a robot speaks; default: that in which it replies."""
    id: Annotated[int | None, ID, arg(metavar="ID")] = None
    """Id of the servo; default: that of the only one on the port."""
    robot: Annotated[str | None, ROBOT, arg(metavar="ROBOT")] = None
    """Name of the robot on the port, or a folder with a robot.toml."""
    joint: Annotated[str | None, arg(metavar="NAME")] = None
    """Joint of the robot."""
    to: Angle = None
    """Angle to move to [°]."""
    by: Angle = None
    """Angle to move by [°]."""
    hold: Annotated[float, between(0.0, 3600.0, "s"), arg(metavar="S")] = 1.0
    """Time for which it is held there [s]."""
    speed: Annotated[float, between(1.0, 180.0, "°/s"), arg(metavar="°/S")] = 30.0
    """Highest speed [°/s]."""
    torque_limit: Annotated[float | None, between(0.001, 1000.0, "N·m"), arg(metavar="N·m")] = None
    """Torque limit [N·m]; default: half of its stall torque."""
    yes: bool = False
    """Do not ask before something is written that the servo keeps without power."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.port:
            yield NO_PORT
        if self.robot and (self.id is not None or self.baud is not None):
            yield "--id and --baud are in the robot's description, expected --joint"
        elif bool(self.robot) != bool(self.joint):
            yield "expected --robot and --joint together, or --id without both"
        if not self.robot and len(self.port) > 1:
            yield f"--port is {','.join(self.port)}, expected one serial port"
        if (self.to is None) == (self.by is None):
            yield "expected one of --to and --by, an angle in degrees"


@program("servo move")
def move(options: MoveServo) -> int:
    """Move a servo; 0 if it arrives."""
    console, kept = console_for(options), ""
    if options.robot:
        with refusing():
            robot: Robot = load_robot(options.robot)
        ports = name_ports(robot, options.port)
    else:
        (path,) = options.port
        with phase("searching"):
            robot, changes = find_bench(path, options.id, options.baud, options.protocol)
        ports = {MAIN_PORT: path}
        kept = ", ".join(f"{register} = {value}" for register, value in changes.items())
    wanted = _choose_move(options, robot)
    joint = robot.joints[wanted.joint]
    name = name_of(joint)
    question = f"{name} keeps {kept} without power: write?"
    if kept and not is_confirmed(console, question, yes=options.yes):
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
    start, target, reached = map(
        math.degrees, (controller.start, controller.target, controller.angle)
    )
    is_estimated = not GroupLayout.of(table_named(joint.servo.model.name)).measures_current
    has_arrived = report.ending is Ending.DONE and abs(controller.target - controller.angle) < CLOSE
    result = {
        "joint": joint.name,
        "id": joint.servo.id,
        "start_deg": start,
        "wanted_deg": target,
        "reached_deg": reached,
        "peak_current_a": controller.peak_current,
        "current_is_estimated": is_estimated,
        "moved": has_arrived,
        "reason": report.reason,
    }
    write_json(result, options)
    if report.ending is not Ending.DONE:
        console.print(f"[bold red]stopped[/]: {report.reason}; torque is off")
        return HARDWARE_FAULT
    peak = f"{controller.peak_current:.2f} A"
    console.print(
        f"{name}: {start:+.1f}° to {reached:+.1f}° of {target:+.1f}°, up to "
        f"{f'~{peak} (estimated from the load)' if is_estimated else peak}; torque is off"
    )
    return DID_IT if has_arrived else DID_NOT_STAND


def _choose_move(options: MoveServo, robot: Robot) -> Move:
    """Choose the joint of the options, and how it moves; check what is known before it is read."""
    TorqueLimit(options.torque_limit).on(robot)
    joint, *_ = choose_joints(robot, [options.joint] if options.joint else ())
    if options.to is not None:
        check_target(robot, joint, math.radians(options.to))
    most = float(robot.max_torque[joint])
    return Move(
        joint=joint,
        target=math.radians(options.to if options.to is not None else options.by or 0.0),
        is_relative=options.to is None,
        speed=math.radians(options.speed),
        torque_limit=min(most, options.torque_limit or SHARE_OF_STALL * most),
        hold=max(options.hold, SETTLE_TIME),
    )
