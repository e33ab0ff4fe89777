"""`getup calibrate`: zeros and signs of a robot's servos, measured with a person at the robot."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.markup import escape
from tyro.conf import arg

from drivers.dynamixel.diagnostics import name_all
from drivers.errors import SetupError
from drivers.serial_port import is_pseudo_terminal
from drivers.service.calibrate import (
    TRIES,
    Calibrator,
    JointMeasurement,
    Prompt,
    check_ranges,
    is_yes,
    save,
)
from drivers.service.session import RobotBus, open_robot_bus
from humanoid_getup.commands.command import program, write_json
from humanoid_getup.commands.console import console_for, make_table
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, BadInputError, refusing
from humanoid_getup.commands.files import READ
from humanoid_getup.commands.inputs import ZERO, choose_joints, find_held_posture, name_ports
from humanoid_getup.commands.options import ServiceOptions
from humanoid_getup.commands.prompt import open_prompt
from robots import Joint, Posture, Robot, load_robot
from robots.description.calibration import CALIBRATION_FILE, CalibrationError

NOT_SAVED = "nothing is saved"
UNFINISHED = f"the input ended before the calibration did: {NOT_SAVED}"
HEADINGS = ("joint", "id", "zero was", "zero is", "differs by °", "sign was", "sign is")
VIRTUAL_FILE = "calibration.virtual.toml"


@dataclass(frozen=True, kw_only=True)
class Calibrate(ServiceOptions):
    """Measure the servos' zeros and directions, torque off.

    The result is the robot's calibration.toml, or calibration.virtual.toml beside it if a port
    is a pseudo-terminal, as of a virtual bus: a trial run leaves the robot's file alone.
    """

    at: Annotated[str | None, READ, arg(metavar="zero|standing|FILE")] = None
    """Posture in which the robot is held while its zeros are measured: all angles 0, its stance,
    or a posture file; default: zero, and with --signs alone no zeros are measured."""
    joint: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Joints to calibrate; default: all."""
    signs: bool = False
    """Measure the servos' directions: a person turns one joint after the other."""
    yes: bool = False
    """Do not ask before torque goes off, before zeros are measured, or before saving."""
    out: Annotated[Path | None, arg(metavar="FILE")] = None
    """Calibration file to write; default: see above."""


@program("calibrate")
def calibrate(command: Calibrate) -> int:
    """Measure, ask, save; 0 if saved, 1 if the person declined."""
    robot = _load_robot(command)
    chosen = [robot.actuators[i] for i in choose_joints(robot, command.joint)]
    held = _choose_posture(command, robot, chosen)
    ports = name_ports(robot, command.port)
    is_virtual = any(map(is_pseudo_terminal, ports.values()))
    path = command.out or robot.folder / (VIRTUAL_FILE if is_virtual else CALIBRATION_FILE)
    if not os.access(path.parent, os.W_OK | os.X_OK):  # before a person does the work
        raise _no_folder(path.parent, "permission denied or read-only")
    console = console_for(command)
    prompt = open_prompt(console, UNFINISHED)
    if prompt is None and (command.signs or not command.yes):
        needed = "--signs needs a person" if command.signs else "it cannot ask (or use --yes)"
        raise BadInputError(f"standard input is not a terminal: {needed}")
    asker = None if command.yes else prompt
    with open_robot_bus(robot, ports) as bus:
        calibrator = Calibrator(bus, chosen)
        calibrator.check()
        if not _release(bus, asker):
            console.print(NOT_SAVED)
            return DID_NOT_STAND
        if command.signs and prompt is not None:
            calibrator.check_signs(prompt)
        if held is not None:
            _measure_zeros(calibrator, command, robot, held, asker)
    measured = calibrator.measured
    _print(measured, console, has_zeros=held is not None)
    check_ranges(measured)
    saved = asker is None or is_yes(asker.ask(f"save to {path}? (yes saves)"))
    if saved:
        try:
            save(robot, measured, path)
        except OSError as error:
            raise _no_folder(path.parent, error.strerror or str(error)) from error
    joints = {row.joint.name: _describe(row) for row in measured}
    kept = str(path) if saved else None
    write_json({"robot": robot.name, "saved": kept, "joints": joints}, command)
    if not saved:
        console.print(NOT_SAVED)
        return DID_NOT_STAND
    console.print(f"[bold green]saved {escape(str(path))}[/]; check the angles: getup doctor")
    if is_virtual and command.out is None:
        console.print("measured on a virtual bus: the robot's own calibration is unchanged")
    return DID_IT


def _load_robot(command: Calibrate) -> Robot:
    """Load the robot with its present calibration."""
    with refusing():
        try:
            return load_robot(command.robot)
        except ValueError as error:
            if isinstance(error.__cause__, CalibrationError):
                raise ValueError(f"{error}; move that file away first") from error
            raise


def _choose_posture(command: Calibrate, robot: Robot, joints: Sequence[Joint]) -> Posture | None:
    """Return the posture to hold; ``None`` to measure no zeros."""
    if command.at is None and command.signs:
        return None
    posture = find_held_posture(robot, command.at or ZERO)
    if command.at not in (None, ZERO):
        return posture
    chosen = [joint.name for joint in joints]
    beyond = [j for j in robot.joints if j.name in chosen and not j.lower <= 0.0 <= j.upper]
    if beyond:
        names = ", ".join(f"'{joint.name}'" for joint in beyond)
        raise BadInputError(f"joint {names} cannot be at 0: name a posture file with --at")
    return posture


def _no_folder(folder: Path, why: str) -> BadInputError:
    return BadInputError(
        f"folder {folder} cannot be written ({why}): name a file with --out, or copy the robot's "
        "folder and name the copy with --robot FOLDER"
    )


def _release(bus: RobotBus, asker: Prompt | None) -> bool:
    """Switch torque off; return whether the person agreed."""
    held = bus.find_torque()
    if held and asker is not None:
        question = f"{name_all(held)} hold the robot up and lose torque now: support it, then yes:"
        if not is_yes(asker.ask(question)):
            return False
    bus.release()
    return True


def _measure_zeros(
    calibrator: Calibrator, command: Calibrate, robot: Robot, held: Posture, asker: Prompt | None
) -> None:
    """Measure the zeros; let a person try again if the robot moved or is held otherwise."""
    orientation = None if command.at in (None, ZERO) else held.orientation
    if asker is not None:
        angles = dict(zip(robot.joint_names, map(math.degrees, held.joint_pos), strict=True))
        chosen = [(m.joint.name, angles[m.joint.name]) for m in calibrator.measured]
        turned = ", ".join(f"{name} {angle:+.1f}°" for name, angle in chosen if round(angle, 1))
        asker.tell(f"bring the robot into the posture: {turned or 'every joint at 0'}")
    for left in reversed(range(1 if asker is None else TRIES)):
        if asker is not None:
            asker.ask("hold it still, then Enter:")
        try:
            calibrator.measure_zeros(held.joint_pos, orientation)
            return
        except SetupError as error:
            if asker is None or not left:
                raise
            asker.tell(str(error))


def _print(measured: Sequence[JointMeasurement], console: Console, *, has_zeros: bool) -> None:
    table = make_table(HEADINGS, left=["joint"])
    for row in measured:
        servo = row.joint.servo
        figures = (servo.id, servo.zero_ticks, row.zero_ticks, f"{row.shift:+.1f}")
        signs = (f"{servo.sign:+d}", f"{row.sign:+d}")
        table.add_row(row.joint.name, *map(str, figures), *signs)
    console.print(table)
    for row in measured:
        for warning in row.warnings:
            console.print(f" [yellow]![/] joint '{escape(row.joint.name)}': {escape(warning)}")
    if not has_zeros and any(row.is_reversed for row in measured):
        console.print(" [yellow]![/] a sign has changed: measure the zeros too (--at)")


def _describe(row: JointMeasurement) -> dict[str, Any]:
    """Describe a measurement for JSON."""
    return {
        "old_zero_ticks": row.joint.servo.zero_ticks,
        "zero_ticks": row.zero_ticks,
        "difference_deg": row.shift,
        "old_sign": row.joint.servo.sign,
        "sign": row.sign,
        "warnings": row.warnings,
    }
