"""`getup replay`: send a flight log's commands to the twin, and compare."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from tyro.conf import Positional, arg

from drivers import Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import make_table
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.files import READ, ROBOT, Written, staging
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.replay import (
    DESCRIBED,
    IDENTIFIED,
    THRESHOLD,
    ReplayReport,
    choose_supply,
    find_closed,
    find_limit_mode,
    replay,
    write_gaps,
)
from humanoid_getup.reporting.replay_page import write_page
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, load_robot
from robots.individual import AS_DESCRIBED, parse_load
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically
from robots.storage.validation import between

REPLAY_FILES = ("replay.json", "replay.html")
FIGURES, PAGE = REPLAY_FILES


@dataclass(frozen=True, kw_only=True)
class ReplayRequest(CommandRequest):
    """Replay a flight log on the twin, as described and as identified; report differences."""

    log: Annotated[Positional[Path], READ, arg(metavar="LOG")]
    """A flight log (.mcap)."""
    robot: Annotated[str | None, ROBOT] = None
    """Name of a robot, or a folder with a robot.toml; default: the log's robot."""
    scene: Annotated[str | None, READ] = None
    """Name of a scene; default: the log's scene, else flat."""
    voltage: Annotated[float | None, between(1.0, 100.0, "V"), arg(metavar="V")] = None
    """Supply voltage of the twin [V]; default: as measured at the start."""
    threshold: Annotated[float | None, between(1e-9, 10.0, "rad"), arg(metavar="RAD")] = None
    """Difference of a joint or of the tilt from which the replay has diverged [rad];
    default: 0.05."""
    out: Annotated[Path | None, Written(REPLAY_FILES), arg(metavar="DIR")] = None
    """Folder for replay.json and the page replay.html."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplayedFlight:
    """A flight log, and what the twin did with its commands."""

    record: FlightRecord
    world: World
    """The world of the twin, with the robot as loaded."""
    twins: dict[str, ReplayReport]
    """Replay on the robot as described, and as identified if it was, by these words."""
    written: tuple[Path, ...]

    @property
    def start(self) -> Literal["logged", "estimated"]:
        """Return how the start was known: from the log, or from its first measurement."""
        return "logged" if self.record.start else "estimated"

    @property
    def scene(self) -> str:
        """Return the name of the scene."""
        return self.world.scene.name

    @property
    def report(self) -> ReplayReport:
        """Return the replay on the robot as described."""
        return self.twins[DESCRIBED]

    def describe(self) -> dict[str, Any]:
        """Describe the replay for JSON, in which ``identified`` is None if nothing was."""
        record, identified = self.record, self.twins.get(IDENTIFIED)
        return self.report.describe() | {
            "identified": identified
            and identified.describe() | {"gap_closed": find_closed(self.report, identified)},
            "log": record.path,
            "started": record.started,
            "about": dict(record.about),
            "start": self.start,
            "truncated": record.truncated,
            "lost_bytes": record.lost_bytes,
            "events": record.events,
        }


@command("replay", json=ReplayedFlight.describe)
def replay_flight(request: ReplayRequest, monitor: ProgressMonitor) -> ReplayedFlight:
    """Replay a flight log on the twin, and write what is requested."""
    monitor.begin("reading")
    with refusing():
        record = FlightRecord.load(request.log)
        worlds = _load_worlds(request, record)
        twins = {name: _replay(request, record, one, monitor) for name, one in worlds.items()}
        *_, world = worlds.values()
    flight = ReplayedFlight(record=record, world=world, twins=twins, written=())
    if request.out is None:
        return flight
    return replace(flight, written=_write(flight, request.out, monitor))


@replay_flight.show
def _print(flight: ReplayedFlight, _: ReplayRequest, console: Console) -> None:
    record, twins = flight.record, flight.twins
    for name, report in twins.items():
        color = "red" if report.divergence else "green"
        console.print(f"[bold {color}]{escape(report.headline)}[/] [dim]({name})")
    console.print(f"[dim]log[/]  {escape(record.describe())}")
    headings, *rows = write_gaps(twins)
    gaps = make_table(headings, left=(headings[0], "most in"))
    for row in rows:
        gaps.add_row(*map(escape, row))
    if not all(report.is_exact for report in twins.values()):
        console.print(gaps)
    table = Table.grid(padding=(0, 2))
    for event in record.events:
        table.add_row(f"[dim]{escape(event.kind)}", f"{event.time:.2f} s: {escape(event.text)}")
    console.print(table)


def _load_worlds(request: ReplayRequest, record: FlightRecord) -> dict[str, World]:
    """Load the robot as described, and as identified if it was, into the scene."""
    body = Body.parse(str(record.about.get("body", "")))
    name = request.robot or record.robot
    load = parse_load(str(record.about.get("load", "")))
    robot, own = (load_robot(name, body, each, load) for each in (AS_DESCRIBED, None))
    record.check_robot(robot)
    scene = request.scene or str(record.about.get("scene", "flat"))
    seed = record.about.get("seed", 0)
    place = load_scene(scene, robot, seed if isinstance(seed, int) else 0)
    robots = {DESCRIBED: robot}
    if not own.individual.is_as_described:
        robots[IDENTIFIED] = own
    return {name: World(each, place) for name, each in robots.items()}


def _replay(
    request: ReplayRequest, record: FlightRecord, world: World, monitor: ProgressMonitor
) -> ReplayReport:
    supply = choose_supply(record, world.robot) if request.voltage is None else request.voltage
    twin = Twin(world, voltage=supply, limit_by=find_limit_mode(record))
    if not record.cycles:
        raise ValueError(f"flight log {request.log}: contains no cycle, expected at least one")
    start = record.start or estimate_posture(world, record.measurement(0))
    return replay(
        record,
        twin,
        start,
        threshold=request.threshold or THRESHOLD,
        advance=monitor.count("replaying", record.cycles),
    )


def _write(flight: ReplayedFlight, out: Path, monitor: ProgressMonitor) -> tuple[Path, ...]:
    """Write figures and page into a folder; return the files."""
    with staging(out, REPLAY_FILES) as folder:
        monitor.begin("drawing")
        write_atomically(folder / FIGURES, to_json(flight.describe()))
        page = write_page(flight.record, flight.twins, _list_facts(flight))
        write_atomically(folder / PAGE, page)
        monitor.check()
    return tuple(out / name for name in REPLAY_FILES)


def _list_facts(flight: ReplayedFlight) -> dict[str, str]:
    record, robot = flight.record, flight.world.robot
    return {
        "log": f"{record.path.name}, {record.describe()}",
        "recorded": ", ".join(
            [record.started, *(f"{k} {v}" for k, v in record.about.items() if v)]
        ),
        "robot": f"{robot.name}, {str(robot.body) or 'original'} body",
        "identified": str(robot.individual) or "nothing",
        "scene": flight.scene,
        "supply": f"{flight.report.curves['supply [V]'][0]:.3g} V on the twin",
        "start": f"posture {flight.start}",
    }
