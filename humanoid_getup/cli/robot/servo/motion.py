"""`getup servo move` and `wiggle`: guarded motion of single servos."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from drivers.dynamixel.diagnostics import name_of
from drivers.safety_guard import SafetyGuard
from drivers.service.servos.guarded_motion import MovedServos, check_target
from drivers.service.servos.waypoints import (
    SETTLE_TIME,
    WaypointController,
    WaypointRun,
    make_move,
    make_wiggle,
    move_through,
)
from drivers.terminal_keys import StopKey
from humanoid_getup.cli.options.servo import MovedOptions, MoveServo, WiggleServos
from humanoid_getup.cli.robot.servo.amperes import describe_current, is_estimated
from humanoid_getup.cli.robot.servo.opening import open_servos, print_end
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import BadInputError
from robots import Robot
from robots.quaternion import Array

CLOSE = 3.0  # degrees from its target within which a servo is there
FOLLOWS = 0.5  # share of a swing that shows that a servo follows


@dataclass(frozen=True, kw_only=True)
class MovedJoint:
    """How far one joint got, for JSON."""

    id: int
    start_deg: float
    wanted_deg: tuple[float, ...]
    reached_deg: tuple[float, ...]
    peak_current_a: float
    current_is_estimated: bool
    """Whether the servo has no sensor for it, only for its load."""
    moved: bool
    """Whether it arrived, or followed each swing."""


def move(command: MoveServo) -> int:
    """Move a servo; 0 if it arrives."""
    console = console_for(command)
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    robot = servos.robot
    if len(servos.chosen) != 1:
        names = ", ".join(robot.joint_names[i] for i in servos.chosen)
        raise BadInputError(f"expected one servo to move, of {names}: give --id or --joint")
    (joint,) = servos.chosen
    if command.to is not None:
        check_target(robot, joint, math.radians(command.to))
    dwell = max(command.hold, SETTLE_TIME)

    def make(start: Array) -> WaypointController:
        by = start[joint] + math.radians(command.by or 0.0)
        target = by if command.to is None else math.radians(command.to)
        return _make_controller(servos, make_move(joint, target, robot), command, dwell=dwell)

    guard = servos.make_guard()
    with StopKey(guard.stop):
        done = move_through(guard, make, realtime=True)
    moved = _describe(robot, joint, done, swing=None)
    write_json({robot.joint_names[joint]: moved}, command)
    print_end(done.report, console)
    if done.arrivals:
        console.print(
            f"{name_of(robot.joints[joint])}: {moved.start_deg:+.1f}° to "
            f"{moved.reached_deg[0]:+.1f}° of {moved.wanted_deg[0]:+.1f}°, up to "
            f"{_describe_peak(moved)}; torque is off"
        )
    if not done.is_whole:
        return HARDWARE_FAULT
    return DID_IT if moved.moved else DID_NOT_STAND


def wiggle(command: WiggleServos) -> int:
    """Swing one servo after the other; 0 if all follow."""
    console = console_for(command)
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    moved: dict[str, MovedJoint] = {}
    guard = servos.make_guard()  # one for all: a key between two of them stops the next, too
    with StopKey(guard.stop):
        for joint in servos.chosen:
            done = _swing(servos, joint, command, guard)
            name = servos.robot.joint_names[joint]
            moved[name] = _describe(servos.robot, joint, done, swing=command.swing)
            if not done.is_whole:
                write_json(moved, command)
                print_end(done.report, console)
                return HARDWARE_FAULT
            _print_wiggle(servos.robot, joint, moved[name], console)
    write_json(moved, command)
    if still := [name for name, each in moved.items() if not each.moved]:
        console.print(f"[bold red]did not follow[/]: {', '.join(still)}")
        return DID_NOT_STAND
    console.print(f"[bold green]{len(moved)} followed[/]; torque is off")
    return DID_IT


def _swing(
    servos: MovedServos, joint: int, command: WiggleServos, guard: SafetyGuard
) -> WaypointRun:
    """Swing one servo to both sides and back."""

    def make(start: Array) -> WaypointController:
        waypoints = make_wiggle(start, joint, math.radians(command.swing), servos.robot)
        return _make_controller(servos, waypoints, command, dwell=SETTLE_TIME)

    return move_through(guard, make, realtime=True)


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
        current_is_estimated=is_estimated(robot.joints[joint]),
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
        f"{_describe_peak(moved)}"
    )


def _describe_peak(moved: MovedJoint) -> str:
    return describe_current(moved.peak_current_a, estimated=moved.current_is_estimated)
