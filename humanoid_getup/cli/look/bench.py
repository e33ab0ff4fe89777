"""`getup bench`: rises from many falls, and the page of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.markup import escape

from humanoid_getup.commands.console import console_for, format_figure, make_table, showing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.options import JobRequest
from humanoid_getup.commands.output import write_json
from humanoid_getup.commands.repeat import hinting_resume
from humanoid_getup.jobs.benchmark import benchmark
from humanoid_getup.jobs.measure_robot import measure_robot
from humanoid_getup.jobs.requests.bench import LEDGER, PAGE, BenchAll, BenchRise

HEADINGS = {
    "n": "n",
    "planned": "planned",
    "stood": "stood",
    "stood_interval_95": "95 %",
    "stand_time_s": "stand [s]",
    "peak_torque_nm": "peak [N·m]",
    "rms_torque_nm": "RMS [N·m]",
    "torque_use": "of limit",
    "head_impact_m_s": "head [m/s]",
    "self_collisions": "self-collisions",
}
"""Figures of the tables, with their headings."""
LOADS = ("stand_time_s", "peak_torque_nm", "rms_torque_nm")


def bench_rise(command: BenchRise) -> int:
    """Run or resume rises by plans, and print their main figures."""
    with hinting_resume("bench rise", command, _has_rises), showing(command) as report:
        result = benchmark(command, report)
    write_json(result, command)
    _print_table(
        "rise",
        result.classes,
        ("n", "planned", "stood", "stood_interval_95", *LOADS, "self_collisions"),
        command,
    )
    return DID_IT


def _has_rises(command: BenchRise) -> bool:
    return command.ledger is not None and command.ledger.exists()


def bench_all(command: BenchAll) -> int:
    """Run or resume the whole benchmark; print its main figures, and the place of its page."""
    with hinting_resume("bench all", command, _is_begun), showing(command) as report:
        result = measure_robot(command, report)
    write_json(result, command)
    figures = ("n", "stood", "stood_interval_95", *LOADS, "torque_use", "head_impact_m_s")
    _print_table("all", result.cases, figures, command)
    console_for(command).print(f"written to {command.out / PAGE}", markup=False)
    return DID_IT


def _is_begun(command: BenchAll) -> bool:
    return (command.out / LEDGER).exists()


def _print_table(
    name: str, cases: Mapping[str, Any], figures: Sequence[str], command: JobRequest
) -> None:
    table = make_table((name, *(HEADINGS[figure] for figure in figures)), left=(name,))
    for case, summary in cases.items():
        table.add_row(escape(case), *(format_figure(getattr(summary, key)) for key in figures))
    console_for(command).print(table)
