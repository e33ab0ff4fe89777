"""`getup replay LOG`: send a flight log's commands to the twin and compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from drivers import Twin
from drivers.flight_log.content import Event
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.cli.options.motions import REPLAY_FILES, ReplayOptions
from humanoid_getup.cli.shared.console import console_for, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.reporting import plots, style_plot
from humanoid_getup.reporting.replay import (
    THRESHOLD,
    ReplayFigures,
    ReplayReport,
    choose_supply,
    replay,
)
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, load_robot
from robots.servo import LIMIT_MODES, LimitMode
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

FIGURES, FLIGHT, DIFFERENCE, STYLE = REPLAY_FILES


@dataclass(frozen=True, kw_only=True)
class ReplayResult(ReplayFigures):
    """The content of replay.json."""

    log: Path
    started: str
    about: Mapping[str, object]
    start: Literal["logged", "estimated"]
    truncated: bool
    lost_bytes: int
    events: Sequence[Event]


def replay_log(command: ReplayOptions) -> int:
    """Load, replay, report."""
    with phase("reading") as report_phase, refusing():
        record = FlightRecord.load(command.log)
        world = _load_world(command, record)
        report_phase("replaying")
        report = _replay(command, record, world)
        figures = ReplayResult(
            log=record.path,
            started=record.started,
            about=dict(record.about),
            start="logged" if record.start else "estimated",
            truncated=record.truncated,
            lost_bytes=record.lost_bytes,
            events=record.events,
            **vars(report.figures()),
        )
        if command.out is not None:
            report_phase("drawing")
            title = f"{record.robot}, {command.log.name}"
            with staging(command.out, REPLAY_FILES) as folder:
                write_atomically(folder / FIGURES, to_json(figures))
                plots.save_flight(record, folder / FLIGHT, title=title)
                plots.save_difference(report, folder / DIFFERENCE, title=f"{title}: replay")
                style_plot.save_flight(record, folder / STYLE, title=f"{title}: style")
                write_json(figures, command)
        else:
            write_json(figures, command)
    _print(record, report, console_for(command))
    return DID_IT


def _load_world(command: ReplayOptions, record: FlightRecord) -> World:
    body = Body.parse(str(record.about.get("body", "")))
    robot = load_robot(command.robot or record.robot, body)
    record.check_robot(robot)
    scene = command.scene or str(record.about.get("scene", "flat"))
    seed = record.about.get("seed", 0)
    return World(robot, load_scene(scene, robot, seed if isinstance(seed, int) else 0))


def _replay(command: ReplayOptions, record: FlightRecord, world: World) -> ReplayReport:
    supply = choose_supply(record, world.robot) if command.voltage is None else command.voltage
    twin = Twin(world, voltage=supply, limit_by=_find_limit_mode(record))
    if not record.cycles:
        raise ValueError(f"flight log {command.log}: contains no cycle, expected at least one")
    start = record.start or estimate_posture(world, record.measurement(0))
    return replay(record, twin, start, threshold=command.threshold or THRESHOLD)


def _find_limit_mode(record: FlightRecord) -> LimitMode | None:
    """Find what the flight's torque limit acted on; a log that does not say it flew as usual."""
    return next((mode for mode in LIMIT_MODES if mode == record.about.get("limit_by")), None)


def _print(record: FlightRecord, report: ReplayReport, console: Console) -> None:
    figures = report.figures()
    rows = (
        ("joints", figures.rms_rad, figures.max_rad),
        ("tilt", figures.tilt_rms_rad, figures.tilt_max_rad),
    )
    console.print(f"[bold {'red' if report.divergence else 'green'}]{_headline(report)}")
    table = Table.grid(padding=(0, 2))
    table.add_row("[dim]log", record.describe())
    if not report.is_exact:
        for label, rms, largest in rows:
            table.add_row(f"[dim]{label}", f"RMS {rms:.4f} rad, at most {largest:.4f} rad")
    for event in record.events:
        table.add_row(f"[dim]{event.kind}", f"{event.time:.2f} s: {event.text}")
    console.print(table)


def _headline(report: ReplayReport) -> str:
    if report.is_exact:
        return "the twin moved exactly as logged"
    if (first := report.divergence) is None:
        return f"no joint and no tilt differed by more than {report.threshold:g} rad"
    return f"{first.part} differed by {first.difference:+.3f} rad after {first.time:.2f} s"
