"""`getup servo move`, `wiggle`, `jog`: guarded motion of single servos."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table

from drivers.control_loop import Ending, RunReport, run
from drivers.dynamixel.diagnostics import name_of
from drivers.service.servos.found_bench import find_bench
from drivers.service.servos.guarded_motion import MovedServos, check_target, choose_servos
from drivers.service.servos.jog import JogController
from drivers.service.servos.waypoints import (
    SETTLE_TIME,
    WaypointController,
    WaypointRun,
    make_wiggle,
    move_through,
)
from drivers.terminal_keys import StopKey, TerminalKeys
from humanoid_getup.cli.options.servo import JogServos, MovedOptions, MoveServo, WiggleServos
from humanoid_getup.cli.shared.console import console_for, make_table, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import is_confirmed
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import name_ports
from robots import Robot, load_robot
from robots.bus_settings import MAIN_PORT
from robots.quaternion import Array

NOT_WRITTEN = "nothing is written, nothing moved"
CLOSE = 3.0  # degrees from its target within which a servo is there
FOLLOWS = 0.5  # share of a swing that shows that a servo follows
RATE = 5.0  # tables per second
STEPS = {b"\x1b[C": 1, b"\x1b[D": -1, b"\x1b[A": 5, b"\x1b[B": -5}
"""Steps of the keys right, left, up and down."""
KEY = re.compile(rb"\x1b\[[A-D]|.", re.DOTALL)
KEYS = "← → one step, ↑ ↓ five; n and p choose another servo, space releases it, q ends"


@dataclass(frozen=True, kw_only=True)
class MovedJoint:
    """How far one joint got, for JSON."""

    id: int
    start_deg: float
    wanted_deg: tuple[float, ...]
    reached_deg: tuple[float, ...]
    peak_current_a: float
    moved: bool
    """Whether it arrived, or followed each swing."""


def move(command: MoveServo) -> int:
    """Move a servo; 0 if it arrives."""
    console = console_for(command)
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    if len(servos.chosen) != 1:
        names = ", ".join(servos.robot.joint_names[i] for i in servos.chosen)
        raise BadInputError(f"expected one servo to move, of {names}: give --id or --joint")
    joint = servos.chosen[0]
    if command.to is not None:
        check_target(servos.robot, joint, math.radians(command.to))
    guard = servos.make_guard()
    with StopKey(guard.stop), guard:
        here = guard.read().joint_pos
        angle = here[joint] + math.radians(command.by or 0.0)
        if command.to is not None:
            angle = math.radians(command.to)
        check_target(servos.robot, joint, angle)
        waypoints = np.full((1, servos.robot.n), np.nan)
        waypoints[0, joint] = angle
        controller = _make_controller(
            servos, waypoints, command, dwell=max(command.hold, SETTLE_TIME)
        )
        done = move_through(guard, controller, realtime=True)
    moved = _describe(servos.robot, joint, done, swing=None)
    write_json({servos.robot.joint_names[joint]: moved}, command)
    _print_end(done.report, console)
    name = name_of(servos.robot.joints[joint])
    if done.arrivals:
        console.print(
            f"{name}: {moved.start_deg:+.1f}° to {moved.reached_deg[0]:+.1f}° of "
            f"{moved.wanted_deg[0]:+.1f}°, up to {moved.peak_current_a:.2f} A; torque is off"
        )
    return _exit_code(done, arrived=moved.moved)


def wiggle(command: WiggleServos) -> int:
    """Swing one servo after the other; 0 if all follow."""
    console = console_for(command)
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    robot, swing = servos.robot, math.radians(command.swing)
    moved: dict[str, MovedJoint] = {}
    failed: WaypointRun | None = None
    with StopKey(lambda reason: guard.stop(reason)):
        for joint in servos.chosen:
            guard = servos.make_guard()
            with guard:
                waypoints = make_wiggle(guard.read().joint_pos, joint, swing, robot)
                controller = _make_controller(servos, waypoints, command, dwell=SETTLE_TIME)
                done = move_through(guard, controller, realtime=True)
            name = robot.joint_names[joint]
            moved[name] = _describe(robot, joint, done, swing=command.swing)
            if not done.is_whole:
                failed = done
                break
            _print_wiggle(robot, joint, moved[name], console)
    write_json(moved, command)
    if failed is not None:
        _print_end(failed.report, console)
        return HARDWARE_FAULT
    silent = [name for name, each in moved.items() if not each.moved]
    if silent:
        console.print(f"[bold red]did not follow[/]: {', '.join(silent)}")
        return DID_NOT_STAND
    console.print(f"[bold green]{len(moved)} followed[/]; torque is off")
    return DID_IT


def jog(command: JogServos) -> int:
    """Move servos by keys until q is pressed."""
    console = console_for(command)
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    robot, step = servos.robot, math.radians(command.by)
    speed = math.radians(command.speed)
    controller = JogController(robot, speed=speed, torque_limit=servos.torque_limit)
    keys = JogKeys(controller, servos.chosen, step)
    if not keys.has_terminal:
        raise BadInputError(
            "standard input is not a terminal: jog needs keys, getup servo move none"
        )
    guard = servos.make_guard()
    with (
        keys,
        Live(
            console=console,
            get_renderable=lambda: Group(f"[dim]{KEYS}", _tabulate(robot, controller)),
            refresh_per_second=RATE,
            transient=True,
        ),
    ):
        report = run(controller, guard, max_time=math.inf, realtime=True)
    _print_end(report, console)
    return DID_IT if report.ending is Ending.DONE else HARDWARE_FAULT


class JogKeys(TerminalKeys):
    """Keys that move the servos of a controller, inside a ``with`` block."""

    def __init__(
        self,
        controller: JogController,
        chosen: Sequence[int],
        step: float,
        terminal: int | None = None,
    ) -> None:
        """Prepare to move some joints, given by their numbers, by a step [rad] a press."""
        super().__init__(self._press_all, terminal)
        self._controller, self._chosen, self._step = controller, chosen, step
        self._place = 0
        controller.choose(chosen[0])

    def _press_all(self, sent: bytes) -> None:
        """Take what a terminal sends at once: several keys where one is held down."""
        if not sent:  # the terminal is gone
            self._controller.end()
        for key in KEY.findall(sent):
            self._press(key)

    def _press(self, key: bytes) -> None:
        if key in STEPS:
            self._controller.nudge(STEPS[key] * self._step)
        elif key in (b"n", b"p"):
            self._place = (self._place + (1 if key == b"n" else -1)) % len(self._chosen)
            self._controller.choose(self._chosen[self._place])
        elif key == b" ":
            self._controller.release()
        elif key == b"q":
            self._controller.end()


# Helpers --------------------------------------------------------------------------------------


def open_servos(command: MovedOptions, console: Console) -> MovedServos | None:
    """Find the servos of a command; None if the person does not agree to what is written."""
    if command.robot:
        robot = load_robot(command.robot)
        ports = name_ports(robot, command.port)
        return choose_servos(robot, ports, command.joint, command.torque_limit)
    if len(command.port) != 1:
        raise BadInputError(f"--port is {','.join(command.port)}, expected one serial port")
    (path,) = command.port
    with phase("searching"):
        found = find_bench(path, command.id, command.baud)
    if changes := found.describe_eeprom():
        question = f"servos keep without power: {'; '.join(changes)}; write?"
        if not is_confirmed(console, question, yes=command.yes):
            console.print(NOT_WRITTEN)
            return None
    return choose_servos(found.bench, {MAIN_PORT: path}, (), command.torque_limit)


def _make_controller(
    servos: MovedServos, waypoints: Array, command: MovedOptions, *, dwell: float
) -> WaypointController:
    return WaypointController(
        servos.robot,
        waypoints,
        speed=math.radians(command.speed),
        torque_limit=servos.torque_limit,
        dwell=dwell,
    )


def _describe(robot: Robot, joint: int, done: WaypointRun, *, swing: float | None) -> MovedJoint:
    """Describe a run; with a swing [°] the joint must have followed it, else arrived."""
    wanted = np.degrees([arrival.wanted[joint] for arrival in done.arrivals])
    reached = np.degrees([arrival.reached[joint] for arrival in done.arrivals])
    start = float(np.degrees(done.start[joint]))
    if swing is None:
        moved = done.is_whole and bool(np.abs(reached - wanted).max() < CLOSE)
    else:
        moved = done.is_whole and _follows(np.concatenate([[start], reached]), wanted, start)
    return MovedJoint(
        id=robot.joints[joint].servo.id,
        start_deg=start,
        wanted_deg=tuple(wanted.tolist()),
        reached_deg=tuple(reached.tolist()),
        peak_current_a=max((float(a.current[joint]) for a in done.arrivals), default=0.0),
        moved=moved,
    )


def _follows(path: Array, wanted: Array, start: float) -> bool:
    """Return whether each move of a path [°] is at least a share of the wanted one."""
    steps = np.diff(np.concatenate([[start], wanted]))
    return bool((np.diff(path) * np.sign(steps) >= FOLLOWS * np.abs(steps)).all())


def _print_wiggle(robot: Robot, joint: int, moved: MovedJoint, console: Console) -> None:
    mark = "[green]✓[/]" if moved.moved else "[red]✗[/]"
    places = ", ".join(f"{angle:+.1f}°" for angle in moved.reached_deg)
    console.print(
        f" {mark} {name_of(robot.joints[joint])}: from {moved.start_deg:+.1f}° to {places}, up to "
        f"{moved.peak_current_a:.2f} A"
    )


def _print_end(report: RunReport, console: Console) -> None:
    """Print why a run ended, unless it was done."""
    if report.ending is not Ending.DONE:
        console.print(f"[bold red]stopped[/]: {report.reason}; torque is off")


def _exit_code(done: WaypointRun, *, arrived: bool) -> int:
    if not done.is_whole:
        return HARDWARE_FAULT
    return DID_IT if arrived else DID_NOT_STAND


def _tabulate(robot: Robot, controller: JogController) -> Table:
    table = make_table(("joint", "id", "°", "wanted °", "A", "°C"), left=["joint"])
    state = controller.state
    if state is None:
        return table
    for i, joint in enumerate(robot.joints):
        is_chosen = i == controller.joint
        wanted = controller.wanted if is_chosen else None
        table.add_row(
            joint.name,
            str(joint.servo.id),
            f"{math.degrees(state.joint_pos[i]):+.1f}",
            "limp" if wanted is None else f"{math.degrees(wanted):+.1f}",
            f"{state.joint_current[i] + 0.0:.2f}",
            f"{state.temperature[i]:.0f}",
            style="bold cyan" if is_chosen else None,
        )
    return table
