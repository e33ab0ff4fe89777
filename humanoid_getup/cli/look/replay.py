"""`getup replay LOG`: send a flight log's commands to the twin and compare."""

from __future__ import annotations

import shlex

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from humanoid_getup.commands.console import console_for, do, showing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.output import write_json
from humanoid_getup.jobs.export_log import export_log as write_bag
from humanoid_getup.jobs.replay_flight import ReplayedFlight, replay_flight
from humanoid_getup.jobs.requests.look import ExportLogRequest, ReplayRequest


def replay_log(command: ReplayRequest) -> int:
    """Replay, report."""
    with showing(command) as report:
        flight = replay_flight(command, report)
    write_json(flight.describe(), command)
    _print(flight, console_for(command))
    return DID_IT


def _print(flight: ReplayedFlight, console: Console) -> None:
    record, report, figures = flight.record, flight.report, flight.report.figures()
    rows = (
        ("joints", figures.rms_rad, figures.max_rad),
        ("tilt", figures.tilt_rms_rad, figures.tilt_max_rad),
    )
    console.print(f"[bold {'red' if report.divergence else 'green'}]{report.headline}")
    table = Table.grid(padding=(0, 2))
    table.add_row("[dim]log", escape(record.describe()))
    if not report.is_exact:
        for label, rms, largest in rows:
            table.add_row(f"[dim]{label}", f"RMS {rms:.4f} rad, at most {largest:.4f} rad")
    for event in record.events:
        table.add_row(f"[dim]{escape(event.kind)}", f"{event.time:.2f} s: {escape(event.text)}")
    console.print(table)


def export_log(command: ExportLogRequest) -> int:
    """Export, and print what the bag contains."""
    found = do(write_bag, command)
    console = console_for(command)
    cut = f", cut off or damaged: {found.lost_bytes} bytes lost" if found.truncated else ""
    console.print(f"{found.robot}, {found.started}, {found.duration_s:.2f} s{cut}", markup=False)
    for topic, count in found.topics.items():
        console.print(f" {topic}: {count} messages", markup=False)
    following = f"ros2 bag info {shlex.quote(str(found.bag))}"
    console.print(f"written to {found.bag}; next: {following}", markup=False, soft_wrap=True)
    return DID_IT
