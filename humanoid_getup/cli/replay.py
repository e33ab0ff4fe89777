"""`getup replay LOG`: send a flight log's commands to the twin and compare."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import positive
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import JsonTarget
from humanoid_getup.cli.output import (
    console_for,
    find_folder_faults,
    find_json_faults,
    phase,
    staging,
    to_json,
    write_json,
)

if TYPE_CHECKING:
    from rich.console import Console

    from drivers.flight_log.reader import FlightRecord
    from humanoid_getup.reporting.replay import ReplayReport
    from humanoid_getup.simulation.world import World

FIGURES, FLIGHT, DIFFERENCE = "replay.json", "flight.png", "replay.png"
ARTEFACTS = (FIGURES, FLIGHT, DIFFERENCE)


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Replay a flight log on the twin and report the differences."""

    log: Annotated[Positional[Path], arg(metavar="LOG")]
    """A flight log (.mcap)."""
    robot: str | None = None
    """Name of a robot, or a folder with a robot.toml; default: the log's robot."""
    scene: str | None = None
    """Name of a scene; default: the log's scene, else flat."""
    voltage: Annotated[float | None, positive("V"), arg(metavar="V")] = None
    """Supply voltage of the twin [V]; default: as measured at the start."""
    threshold: Annotated[float | None, positive("rad"), arg(metavar="RAD")] = None
    """Difference of a joint or of the tilt from which the replay has diverged [rad];
    default: 0.05."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for replay.json, flight.png and replay.png."""
    json: JsonTarget = None

    def run(self) -> int:
        """Load, replay, report."""
        faults = find_json_faults(self.json)
        if self.out is not None:
            faults += find_folder_faults(self.out, ARTEFACTS)
        if faults:
            raise BadInputError("; ".join(faults))
        with phase("reading") as tell, refusing():
            from drivers.flight_log.reader import FlightRecord

            record = FlightRecord.load(self.log)
            world = self._load_stage(record)
            tell("replaying")
            report = self._replay(record, world)
            figures = _describe(record) | report.record()
            if self.out is not None:
                tell("drawing")
                self._write(record, report, figures, self.out)
        write_json(to_json(figures), self.json)
        _print(record, report, console_for(self.json))
        return DID_IT

    def _load_stage(self, record: FlightRecord) -> World:
        from humanoid_getup.simulation.scene import load_scene
        from humanoid_getup.simulation.world import World
        from robots import load_robot

        robot = load_robot(self.robot or record.robot)
        record.check_robot(robot)
        return World(robot, load_scene(self.scene or str(record.about.get("scene", "flat"))))

    def _replay(self, record: FlightRecord, world: World) -> ReplayReport:
        from drivers import Twin
        from humanoid_getup.playback.estimation import estimate_posture
        from humanoid_getup.reporting.replay import THRESHOLD, choose_supply, replay

        supply = choose_supply(record, world.robot) if self.voltage is None else self.voltage
        twin = Twin(world, voltage=supply)
        if not record.cycles:
            raise ValueError(f"flight log {self.log}: contains no cycle, expected at least one")
        start = record.start or estimate_posture(world, record.measurement(0))
        return replay(record, twin, start, threshold=self.threshold or THRESHOLD)

    def _write(
        self, record: FlightRecord, report: ReplayReport, figures: dict[str, Any], out: Path
    ) -> None:
        from humanoid_getup.reporting import plots

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
    from rich.table import Table

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
        return "the twin moved exactly as logged"
    if (first := report.divergence) is None:
        return f"no joint and no tilt differed by more than {report.threshold:g} rad"
    return f"{first.part} differed by {first.difference:+.3f} rad after {first.time:.2f} s"
