"""`getup identify robot`: what sets one robot apart, from the flight logs of its own rises."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import make_table
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, BadInputError, refusing
from humanoid_getup.commands.files import READ, ROBOT, Written, check_different
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, load_robot
from robots.individual import AS_DESCRIBED, IDENTIFIED_FILE, parse_load

if TYPE_CHECKING:
    from sim2real.identification.flight_fit import RobotFit

UNITS = {
    "delay": ("delay, ms", 1e3),
    "com": ("center of mass, mm forward", 1e3),
    "supply_resistance": ("battery and wires, Ω", 1.0),
}


@dataclass(frozen=True, kw_only=True)
class FitRobotRequest(CommandRequest):
    """Identify strength, friction, mass, delay and center of mass of one robot from its rises.

    The first 1.4 s of each flight are replayed on the twin with many values at once (CMA-ES on
    joint angles). Friction by load is added if it is clearly better. Figures are written only if
    replays with them are clearly nearer to the flights than those of the robot as described.
    """

    flights: Annotated[Positional[tuple[Path, ...]], READ, arg(metavar="FLIGHT...")]
    """Flight logs (.mcap) of rises."""
    hold_out: Annotated[tuple[Path, ...], READ, arg(metavar="FLIGHT,...")] = ()
    """Flight logs of other rises, which are not fitted: the check."""
    robot: Annotated[str | None, ROBOT] = None
    """Name of a robot, or a folder with a robot.toml; default: the logs' robot."""
    write: Annotated[Path | None, Written((IDENTIFIED_FILE,)), arg(metavar="DIR")] = None
    """Folder of the robot that gets the figures, in identified.toml beside its calibration."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if not self.flights:
            yield "no flight is given, expected FLIGHT..."
        if self.write is not None and not (self.write / "robot.toml").exists():
            yield f"--write is {self.write}, expected the folder of a robot, with a robot.toml"


@dataclass(frozen=True, kw_only=True)
class IdentifiedRobot:
    """What sets a robot apart from its description."""

    fit: RobotFit
    flights: dict[str, str]
    """SHA-256 of each flight log."""
    written: bool

    def describe(self) -> dict[str, Any]:
        """Describe it for JSON, in SI units but for gaps."""
        fit = asdict(self.fit)
        individual = fit.pop("individual")
        intervals, tilt = individual.pop("intervals"), individual.pop("imu_tilt")
        return (
            {"robot": individual.pop("robot"), "parameters": individual, "intervals": intervals}
            | {"imu_tilt": tilt, **fit}
            | {"is_better": self.fit.is_better, "flights": self.flights, "written": self.written}
        )


@command("identify robot", json=IdentifiedRobot.describe)
def identify_robot(request: FitRobotRequest, monitor: ProgressMonitor) -> IdentifiedRobot:
    """Identify one robot from flights."""
    from sim2real.identification.flight_fit import STEPS, identify
    from sim2real.identification.flight_replay import Excerpt

    monitor.begin("reading")
    paths = (*request.flights, *request.hold_out)
    with refusing():
        records = [FlightRecord.load(path) for path in paths]
        world = _load_world(request, records)
        excerpts = [Excerpt.of(record, world) for record in records]
        told = [(str(path), sha256(path.read_bytes()).hexdigest()) for path in paths]
        check_different(told)
        checksums = dict(told)
    count, advance = len(request.flights), monitor.count("fitting", STEPS)
    fit = identify(world, excerpts[:count], excerpts[count:], steps=STEPS, advance=advance)
    is_written = request.write is not None and fit.is_better
    if request.write is not None and is_written:
        about = ["Identified by `getup identify robot` from flights (SHA-256):"]
        held = set(map(str, request.hold_out))
        about += [
            f"{'/'.join(Path(name).parts[-2:])}{', held out' * (name in held)}: {checksum}"
            for name, checksum in checksums.items()
        ]
        if fit.not_identified:
            about.append(f"Not identified one by one: {', '.join(fit.not_identified)}")
        fit.individual.save(request.write / IDENTIFIED_FILE, about)
    return IdentifiedRobot(fit=fit, flights=checksums, written=is_written)


@identify_robot.show
def _print(found: IdentifiedRobot, request: FitRobotRequest, console: Console) -> int:
    fit, own = found.fit, found.fit.individual
    table = make_table((own.robot, "value", "95 %"), left=(own.robot,))
    for name, (lower, upper) in own.intervals.items():
        label, scale = UNITS.get(name, (name.replace("_", " "), 1.0))
        reach = f"{scale * lower:.3g} to {scale * upper:.3g}"
        reach = "not identified" if name in fit.not_identified else reach
        table.add_row(label, f"{scale * getattr(own, name):.3g}", reach)
    tilt = ", ".join(f"{math.degrees(angle):.1f}" for angle in own.imu_tilt)
    table.add_row("IMU mounting, ° about x, y, z", tilt, "")
    console.print(table)
    fitted = f"gap along the flights {fit.fitted_gap_mrad:.1f} mrad; " if request.hold_out else ""
    checked = "along those held out" if request.hold_out else "along the flights"
    console.print(
        f"{fitted}{checked} {fit.gap_mrad:.1f} mrad, as described {fit.catalog_gap_mrad:.1f} mrad"
    )
    for warning in fit.warnings:
        console.print(f"[yellow]![/] {escape(warning)}")
    if not fit.is_better:
        console.print("not to be used: no better than the robot as described")
        return DID_NOT_STAND
    if request.write is not None:
        console.print(f"written to {request.write / IDENTIFIED_FILE}", markup=False, soft_wrap=True)
    return DID_IT


def _load_world(request: FitRobotRequest, records: Sequence[FlightRecord]) -> World:
    """Load the robot into the scene in which it flew."""
    first, *others = records
    flown = {"body": "", "load": "", "scene": "flat"}
    body, load, scene = same = [str(first.about.get(*each)) for each in flown.items()]
    name = request.robot or first.robot
    robot = load_robot(name, Body.parse(body), AS_DESCRIBED, parse_load(load))
    if request.write is not None and load_robot(request.write).name != robot.name:
        raise BadInputError(f"--write is {request.write}, expected the folder of {robot.name}")
    for other in others:
        if [str(other.about.get(*each)) for each in flown.items()] != same:
            raise BadInputError(
                f"flight log {other.path}: body, load or scene differ from those of {first.path}"
            )
    return World(robot, load_scene(scene, robot))
