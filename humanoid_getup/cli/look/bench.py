"""`getup bench NAME`: benchmarks on the twin and on the virtual bus."""

from __future__ import annotations

from rich.markup import escape
from rich.table import Table

from humanoid_getup.benchmarks.bench_result import BenchHead
from humanoid_getup.cli.shared.console import console_for, format_figure, showing
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.repeat import hinting_resume
from humanoid_getup.jobs.benchmark import benchmark
from humanoid_getup.jobs.requests.bench import BODIES_PAGE, PAGE, BenchAll, BenchBodies, BenchRise
from humanoid_getup.jobs.requests.shared import JobRequest
from humanoid_getup.jobs.run_parts import is_begun

SAFETY_FIGURES = ("n", "succeeded", "endings", "safe_max_s", "beyond_limits", "believed_wrong")
LOAD_FIGURES = ("stand_time_s", "peak_torque_nm", "rms_torque_nm")
FIGURES = {
    "all": ("n", "stood", "stood_interval_95", *LOAD_FIGURES, "torque_use", "head_impact_m_s"),
    "bodies": ("n", "stood", "stood_interval_95", "head_in_time", "head_at_end", *LOAD_FIGURES),
    "rise": ("n", "planned", "stood", "stood_interval_95", *LOAD_FIGURES, "self_collisions"),
    "sweep": ("n", "stood", "stood_interval_95", *LOAD_FIGURES),
    "methods": ("n", "stood", *LOAD_FIGURES, "head_impact_m_s", "hottest_after_ten_rises_c"),
    "disturbed": ("n", "stood", "stood_interval_95", "refused", *LOAD_FIGURES, "head_impact_m_s"),
    "scenes": ("n", "planned", "stood", "stood_interval_95", "refused", *LOAD_FIGURES),
    "motions": (*LOAD_FIGURES, "lowest_torque_limit_nm", "disturbed_succeeded"),
    "sit": ("n", "succeeded", "interval_95", "head_impact_max_m_s", "torso_impact_max_m_s"),
    "filter": ("n", "filter_over_bare_steps_per_s"),
    "faults": SAFETY_FIGURES,
    "kill": SAFETY_FIGURES,
    "soak": (
        "n",
        "stood",
        "lay_down",
        "faster_than_real_time",
        "unexplained_s",
        "memory_mib",
    ),
}
"""Figures of each benchmark's table, by its name."""
HEADINGS = {
    "n": "n",
    "planned": "planned",
    "stood": "stood",
    "succeeded": "succeeded",
    "stood_interval_95": "95 %",
    "interval_95": "95 %",
    "refused": "refused",
    "head_in_time": "head up at 5 s",
    "head_at_end": "head up",
    "stand_time_s": "stand [s]",
    "peak_torque_nm": "peak [N·m]",
    "rms_torque_nm": "RMS [N·m]",
    "torque_use": "of limit",
    "head_impact_m_s": "head [m/s]",
    "head_impact_max_m_s": "head, max [m/s]",
    "torso_impact_max_m_s": "torso, max [m/s]",
    "self_collisions": "self-collisions",
    "hottest_after_ten_rises_c": "after ten [°C]",
    "lowest_torque_limit_nm": "lowest limit [N·m]",
    "disturbed_succeeded": "disturbed",
    "filter_over_bare_steps_per_s": "over bare steps",
    "endings": "endings",
    "safe_max_s": "safe after, max [s]",
    "beyond_limits": "beyond limits",
    "believed_wrong": "believed wrong",
    "lay_down": "lay down",
    "faster_than_real_time": "faster than real time",
    "unexplained_s": "unexplained [s]",
    "memory_mib": "memory [MiB]",
}
"""Headings of the figures in tables."""


def bench(command: JobRequest) -> int:
    """Run a benchmark, and print its main figures."""
    with showing(command) as report:
        result = benchmark(command, report)
    return write_results(result, command)


def bench_rise(command: BenchRise) -> int:
    """Run or resume rises by plans, and print their main figures."""
    with hinting_resume("bench rise", command, _has_rises):
        return bench(command)


def _has_rises(command: BenchRise) -> bool:
    return command.ledger is not None and command.ledger.exists()


def bench_all(command: BenchAll) -> int:
    """Run or resume the whole benchmark; print the place of its page."""
    return _bench_page("bench all", command, PAGE)


def bench_bodies(command: BenchBodies) -> int:
    """Run or resume the benchmark over bodies; print the place of its page."""
    return _bench_page("bench bodies", command, BODIES_PAGE)


def _bench_page(name: str, command: BenchAll | BenchBodies, page: str) -> int:
    with hinting_resume(name, command, is_begun):
        code = bench(command)
    console_for(command).print(f"written to {command.out / page}", markup=False)
    return code


def write_results(result: BenchHead, command: JobRequest) -> int:
    """Write the results, print the main figures as a table, and return the exit code.

    The code is 1 if a limit was passed, a wrong position believed, or a robot never safe.
    """
    write_json(result, command)
    figures = FIGURES[result.name]
    headings = [escape(HEADINGS[figure]) for figure in figures]
    table = Table(result.name, *headings, box=None, header_style="bold")
    for name, case in result.table.items():
        table.add_row(name, *(format_figure(getattr(case, figure)) for figure in figures))
    console_for(command).print(table)
    harms = ("beyond_limits", "believed_wrong", "never_safe")
    harmed = any(getattr(case, harm, 0) for case in result.table.values() for harm in harms)
    return DID_NOT_STAND if harmed else DID_IT
