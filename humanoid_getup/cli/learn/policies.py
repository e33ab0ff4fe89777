"""`getup policy import` and `check`: policies of other projects."""

from __future__ import annotations

from humanoid_getup.commands.console import console_for, do
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.experiments.judging.summary import Quantiles
from humanoid_getup.jobs.evaluate_policy import EvaluatedCase
from humanoid_getup.jobs.evaluate_policy import evaluate as judge
from humanoid_getup.jobs.foreign_policy import check_policy as compare
from humanoid_getup.jobs.foreign_policy import import_policy as read_and_write
from humanoid_getup.jobs.requests.learning import (
    CheckPolicyRequest,
    EvaluateRequest,
    ImportPolicyRequest,
)

COLUMNS = {
    "to stand [s]": "stand_time_s",
    "RMS [N·m]": "rms_torque_nm",
    "head [m/s]": "head_impact_m_s",
    "height error": "height_error",
    "angle error [deg]": "angle_error_deg",
    "restarts": "restarts",
}
"""Headings of the printed tables, and keys of the JSON."""
FOLLOWED = ("height_error", "angle_error_deg", "restarts")
"""Keys of the figures of a followed style."""
LEGEND = (
    "median (95th percentile); times and torques are those of rises that stood, all else of all"
)


def evaluate(command: EvaluateRequest) -> int:
    """Evaluate the policy; print a table of each case."""
    found = do(judge, command)
    console = console_for(command)
    for label, case in found.cases.items():
        text = f"{found.policy}, {label}; robots {found.trial}:\n\n{_tabulate(case)}\n"
        console.print(text, markup=False, soft_wrap=True)
    console.print(LEGEND, soft_wrap=True)
    return DID_IT


def _tabulate(case: EvaluatedCase) -> str:
    """Write the figures of a case as a Markdown table, by class and over all."""
    columns = {
        heading: key for heading, key in COLUMNS.items() if case.style or key not in FOLLOWED
    }
    rows = [["", "stood", "95 %", *columns]]
    for name, row in (*case.classes.items(), ("all", case.all)):
        low, high = row.stood_interval_95
        interval = f"{100.0 * low:.0f} to {100.0 * high:.0f} %"
        cells = [_format_spread(getattr(row, key)) for key in columns.values()]
        rows.append([name, f"{row.stood} of {row.n}", interval, *cells])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rule = ["-" * width for width in widths]
    lines = [rows[0], rule, *rows[1:]]
    return "\n".join(
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))} |"
        for line in lines
    )


def _format_spread(spread: Quantiles) -> str:
    """Write a median and, in parentheses, a 95th percentile; a dash for none."""
    median, p95 = spread.median, spread.p95
    return "-" if median is None or p95 is None else f"{median:.2f} ({p95:.2f})"


def import_policy(command: ImportPolicyRequest) -> int:
    """Import a policy; print its description with sources, and notes."""
    found = do(read_and_write, command)
    console = console_for(command)
    console.print(f"{command.network}: {found.format}, for robot '{found.robot}'", markup=False)
    for row in found.fields:
        text = f"  {row.field}: {row.value} ({row.source})"
        console.print(text, markup=False, soft_wrap=True)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    run = f"getup run {found.file} --robot {command.robot} --from supine"
    console.print(f"written to {command.out}; next: {run}", markup=False, soft_wrap=True)
    return DID_IT


def check_policy(command: CheckPolicyRequest) -> int:
    """Compare a policy with a trace; print a line for observations and one for actions."""
    found = do(compare, command)
    console = console_for(command)
    for compared in found.comparisons:
        console.print(compared.describe(), markup=False, soft_wrap=True)
    return DID_IT if found.agrees else DID_NOT_STAND
