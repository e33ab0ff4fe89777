"""`getup first-steps`: from a port to the first rise."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median

from drivers.serial_port import is_pseudo_terminal
from humanoid_getup.cli.options.first_steps import FirstSteps
from humanoid_getup.cli.robot.first_steps.desk_steps import list_desk_steps
from humanoid_getup.cli.robot.first_steps.finished_steps import FinishedSteps
from humanoid_getup.cli.robot.first_steps.own_program import run_getup
from humanoid_getup.cli.robot.first_steps.robot_steps import (
    DOCTOR_FILE,
    RobotAtPort,
    list_robot_steps,
)
from humanoid_getup.cli.robot.first_steps.step import FirstStep
from humanoid_getup.cli.robot.first_steps.walk import Walk
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.prompt import open_prompt
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_robot, name_ports
from robots.bench import ServoBench

UNFINISHED = "the input ended before the last step: getup first-steps goes on where it ended"
DESK = "desk"


def first_steps(command: FirstSteps) -> int:
    """Lead a person through the steps; 0 once all are done."""
    console = console_for(command)
    prompt = open_prompt(console, UNFINISHED)
    if prompt is None:
        raise BadInputError("standard input is not a terminal: first-steps needs a person")
    list_steps, owner = _choose_steps(command)
    folder = command.out or Path("out") / "first-steps" / owner
    steps = list_steps(folder)
    names = [step.name for step in steps]
    if command.step is not None and command.step not in names:
        raise BadInputError(f"unknown step '{command.step}', expected {', '.join(names)}")
    folder.mkdir(parents=True, exist_ok=True)
    paths = [word.rpartition("=")[2] for word in command.port]
    walk = Walk(
        lambda: list_steps(folder),
        folder,
        FinishedSteps.load(folder, owner),
        prompt=prompt,
        console=console,
        is_virtual=any(map(is_pseudo_terminal, paths)),
        run=run_getup,
    )
    return walk.go(command.step)


def _choose_steps(command: FirstSteps) -> tuple[Callable[[Path], Sequence[FirstStep]], str]:
    """Choose the steps of a robot or of loose servos; return their list and its owner's name."""
    if command.desk:
        (port,) = command.port
        return lambda _: list(list_desk_steps(port)), DESK
    robot = load_robot(command, takes_bench=True)
    name_ports(robot, command.port)
    if isinstance(robot, ServoBench):
        raise BadInputError(f"robot '{robot.name}' is servos on a bench, expected --desk for them")
    known = RobotAtPort(
        robot=robot,
        chosen=command.robot,
        port=command.port,
        out=Path(),
        torque_limit=command.torque_limit,
    )

    def list_steps(folder: Path) -> Sequence[FirstStep]:
        measured = read_voltage(folder / DOCTOR_FILE)
        return list(list_robot_steps(replace(known, out=folder, voltage=measured)))

    return list_steps, robot.name


def read_voltage(file: Path) -> float | None:
    """Read the supply that the doctor measured [V]; None if it has not yet."""
    try:
        joints = json.loads(file.read_text("utf-8"))["joints"].values()
        return median(joint["voltage_v"] for joint in joints)
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return None
