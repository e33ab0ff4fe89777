"""`getup replay LOG`: send a flight log's commands to the twin and tell what differs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.table import Table
from tyro.conf import Positional, arg

from drivers import Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.output import (
    console_for,
    find_folder_faults,
    find_json_faults,
    staging,
    to_json,
    write_json,
)
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.reporting import plots
from humanoid_getup.reporting.replay import THRESHOLD, ReplayReport, choose_supply, replay
from humanoid_getup.simulation.scene import load_scene
from humanoid_getup.simulation.world import World
from robots import load_robot

FIGURES, FLIGHT, DIFFERENCE = "replay.json", "flight.png", "replay.png"
ARTEFACTS = (FIGURES, FLIGHT, DIFFERENCE)


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Play a flight log on the twin and tell what differs."""

    log: Annotated[Positional[Path], arg(metavar="LOG")]
    """A flight log (.mcap)."""
    robot: str | None = None
    """Robot by name, or a folder that holds a robot.toml; without it, by the log's name."""
    scene: str | None = None
    """Scene by name; without it, the log's, else flat."""
    voltage: Annotated[float | None, arg(metavar="V")] = None
    """Supply of the twin [V]; without it, what was measured at the start."""
    threshold: Annotated[float, arg(metavar="RAD")] = THRESHOLD
    """Difference of a joint or of the tilt from which the replay has diverged [rad]."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for replay.json, flight.png and replay.png."""
    json: Annotated[str | None, arg(metavar="FILE|-")] = None
    """Write the figures to a file; - prints them alone on standard output."""

    def run(self) -> int:
        """Load, replay, tell."""
        if faults := self.find_faults():
            raise BadInputError("; ".join(faults))
        with Console(stderr=True).status("reading") as status, refusing():
            record = FlightRecord.load(self.log)
            world = self._load_stage(record)
            status.update("replaying")
            report = self._replay(record, world)
            status.update("drawing")
            figures = _describe(record) | report.record()
            if self.out is not None:
                self._write(record, report, figures, self.out)
        write_json(to_json(figures), self.json)
        _print(record, report, console_for(self.json))
        return DID_IT

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = find_json_faults(self.json)
        if self.out is not None:
            faults += find_folder_faults(self.out, ARTEFACTS)
        for name, value, unit in (
            ("threshold", self.threshold, "rad"),
            ("voltage", self.voltage, "V"),
        ):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                faults.append(f"{name} is {value:g} {unit}, allowed a finite number above 0 {unit}")
        return faults

    def _load_stage(self, record: FlightRecord) -> World:
        robot = load_robot(self.robot or record.robot)
        record.check_robot(robot)
        return World.build(robot, load_scene(self.scene or str(record.about.get("scene", "flat"))))

    def _replay(self, record: FlightRecord, world: World) -> ReplayReport:
        supply = choose_supply(record, world.robot) if self.voltage is None else self.voltage
        twin = Twin(world.robot, world.model, voltage=supply)
        if not record.cycles:
            raise ValueError(f"flight log {self.log}: it holds no cycle, nothing to replay")
        start = record.start or estimate_posture(world, record.measurement(0))
        return replay(record, twin, start, threshold=self.threshold)

    def _write(
        self, record: FlightRecord, report: ReplayReport, figures: dict[str, Any], out: Path
    ) -> None:
        title = f"{record.robot}, {self.log.name}"
        with staging(out, ARTEFACTS) as folder:
            (folder / FIGURES).write_text(to_json(figures), "utf-8")
            plots.save_flight(record, folder / FLIGHT, title=title)
            plots.save_difference(report, folder / DIFFERENCE, title=f"{title}: replay")


def _describe(record: FlightRecord) -> dict[str, Any]:
    return {
        "log": str(record.path),
        "started": record.started,
        "about": dict(record.about),
        "start": "logged" if record.start else "estimated",
        "truncated": record.truncated,
        "lost_bytes": record.lost_bytes,
        "events": [vars(event) for event in record.events],
    }


def _print(record: FlightRecord, report: ReplayReport, console: Console) -> None:
    figures = report.record()
    console.print(f"[bold {'red' if report.divergence else 'green'}]{_headline(report)}")
    table = Table.grid(padding=(0, 2))
    table.add_row("[dim]log", record.describe())
    if not report.is_exact:
        for label, key in (("joints", ""), ("tilt", "tilt_")):
            rms, largest = figures[f"{key}rms_rad"], figures[f"{key}max_rad"]
            table.add_row(f"[dim]{label}", f"RMS {rms:.4f} rad, at most {largest:.4f} rad")
    for event in record.events:
        table.add_row(f"[dim]{event.kind}", f"{event.time:.2f} s: {event.text}")
    console.print(table)


def _headline(report: ReplayReport) -> str:
    if report.is_exact:
        return "the twin did exactly the same"
    if (first := report.divergence) is None:
        return f"no joint and no tilt differed by more than {report.threshold:g} rad"
    return f"{first.part} differed by {first.difference:+.3f} rad after {first.time:.2f} s"
