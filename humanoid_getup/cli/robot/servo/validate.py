"""`getup servo validate`: named checks of servos, virtual ones or those on a port."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from rich.console import Console
from rich.table import Table

from drivers.dynamixel.diagnostics import name_of
from drivers.service.servos.validate import ServoValidator
from drivers.service.servos.validation import Validation, find_failed
from drivers.terminal_keys import StopKey
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import serve_robot
from drivers.virtual_bus.serving.server import TimeMode
from humanoid_getup.cli.options.servo import ValidateServos
from humanoid_getup.cli.robot.bench_words import build_bench
from humanoid_getup.cli.robot.servo.opening import open_servos
from humanoid_getup.cli.shared.console import console_for, make_table
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from robots.bus_settings import MAIN_PORT

HEADINGS = ("validation", "measured", "limit", "", "remark")
MARKS = {True: "[green]✓[/]", False: "[bold red]✗[/]", None: "[dim]not applicable[/]"}


@dataclass(frozen=True, kw_only=True)
class ValidationRow:
    """Result of a check, for JSON."""

    measured: float | None
    """None where it could not be measured."""
    limit: float
    unit: str
    passed: bool | None
    """None where it is not applicable to a servo of this kind."""
    remark: str


def validate(command: ValidateServos) -> int:
    """Validate servos; 1 if one fails a check."""
    console = console_for(command)
    with _serving(command) as (port, yes):
        return _validate(replace(command, port=port, yes=yes), console)


@contextmanager
def _serving(command: ValidateServos) -> Iterator[tuple[tuple[str, ...], bool]]:
    """Yield the ports of a command, or that of its virtual servos, and whether not to ask."""
    if not command.servos:
        yield command.port, command.yes
        return
    bench = build_bench(command.servos, command.load)
    with serve_robot(Simulation(bench), time_mode=TimeMode.REAL_TIME, powered=True) as served:
        served.place(bench.standing)
        yield (served.paths[MAIN_PORT],), True


def _validate(command: ValidateServos, console: Console) -> int:
    servos = open_servos(command, console)
    if servos is None:
        return DID_NOT_STAND
    speed, swing = math.radians(command.speed), math.radians(command.swing)
    validator = ServoValidator(servos, speed=speed, swing=swing)
    results: dict[str, list[Validation]] = {}
    with StopKey(validator.stop):
        for joint in servos.chosen:
            device = servos.robot.joints[joint]
            console.print(f"{name_of(device)}, {device.servo.model.name}:")
            results[device.name] = validator.validate(joint)
            console.print(tabulate(results[device.name]))
    write_json({name: describe(found) for name, found in results.items()}, command)
    return _print_end(results, console)


def tabulate(validations: Sequence[Validation]) -> Table:
    """Make a table of validations."""
    table = make_table(HEADINGS, left=("validation", "", "remark"))
    for validation in validations:
        table.add_row(
            validation.check.value,
            "-" if validation.measured is None else f"{validation.measured:.3g}",
            f"{validation.limit:.3g} {validation.unit}".rstrip(),
            MARKS[validation.passed],
            validation.remark,
        )
    return table


def describe(validations: Sequence[Validation]) -> dict[str, ValidationRow]:
    """Describe validations by name, for JSON."""
    return {
        each.check.name.lower(): ValidationRow(
            measured=each.measured,
            limit=each.limit,
            unit=each.unit,
            passed=each.passed,
            remark=each.remark,
        )
        for each in validations
    }


def _print_end(results: Mapping[str, Sequence[Validation]], console: Console) -> int:
    failed = {name: find_failed(found) for name, found in results.items()}
    for name, checks in failed.items():
        if checks:
            listed = ", ".join(check.value for check in checks)
            console.print(f"[bold red]failed[/]: joint '{name}': {listed}")
    if any(failed.values()):
        return DID_NOT_STAND
    console.print(f"[bold green]{len(results)} passed[/]; torque is off")
    return DID_IT
