"""`getup identify robot`: what sets one robot apart, from the flight logs of its own rises."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from tyro.conf import Positional, arg

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import make_table
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.files import READ, ROBOT
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, load_robot

if TYPE_CHECKING:
    from sim2real.identification.flight_fit import RobotFit

UNITS = {"delay": ("delay, ms", 1e3), "com": ("center of mass, mm forward", 1e3)}


@dataclass(frozen=True, kw_only=True)
class FitRobotRequest(CommandRequest):
    """Identify strength, friction, mass, delay and center of mass of one robot from its rises.

    The first 1.4 s of each flight are replayed on the twin with many values at once (CMA-ES on
    joint angles). Friction by load is added if it is clearly better.
    """

    flights: Annotated[Positional[tuple[Path, ...]], READ, arg(metavar="FLIGHT...")]
    """Flight logs (.mcap) of rises."""
    hold_out: Annotated[tuple[Path, ...], READ, arg(metavar="FLIGHT,...")] = ()
    """Flight logs of other rises, which are not fitted: the check."""
    robot: Annotated[str | None, ROBOT] = None
    """Name of a robot, or a folder with a robot.toml; default: the logs' robot."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if both := set(self.flights) & set(self.hold_out):
            names = ", ".join(sorted(map(str, both)))
            yield f"--hold-out is {names}, expected other flights than those that are fitted"


@dataclass(frozen=True, kw_only=True)
class IdentifiedRobot:
    """What sets a robot apart from its description."""

    robot: str
    fit: RobotFit
    flights: dict[str, str]
    """SHA-256 of each flight log."""

    def describe(self) -> dict[str, Any]:
        """Describe it for JSON, in SI units but for gaps."""
        return {"robot": self.robot} | asdict(self.fit) | {"flights": self.flights}


@command("identify robot", json=IdentifiedRobot.describe)
def identify_robot(request: FitRobotRequest, monitor: ProgressMonitor) -> IdentifiedRobot:
    """Identify one robot from flights."""
    from sim2real.identification.flight_fit import STEPS, Excerpt, identify

    monitor.begin("reading")
    paths = (*request.flights, *request.hold_out)
    with refusing():
        records = [FlightRecord.load(path) for path in paths]
        world = _load_world(request, records)
        excerpts = [Excerpt.of(record, world) for record in records]
        checksums = {str(path): sha256(path.read_bytes()).hexdigest() for path in paths}
    count, advance = len(request.flights), monitor.count("fitting", STEPS)
    fit = identify(world, excerpts[:count], excerpts[count:], steps=STEPS, advance=advance)
    return IdentifiedRobot(robot=world.robot.name, fit=fit, flights=checksums)


@identify_robot.show
def _print(found: IdentifiedRobot, request: FitRobotRequest, console: Console) -> None:
    fit = found.fit
    table = make_table((found.robot, "value", "95 %"), left=(found.robot,))
    for name, value in fit.parameters.items():
        label, scale = UNITS.get(name, (name.replace("_", " "), 1.0))
        lower, upper = (scale * end for end in fit.intervals[name])
        reach = "not identified" if name in fit.not_identified else f"{lower:.3g} to {upper:.3g}"
        table.add_row(label, f"{scale * value:.3g}", reach)
    console.print(table)
    fitted = f"gap along the flights {fit.fitted_gap_mrad:.1f} mrad; " if request.hold_out else ""
    checked = "along those held out" if request.hold_out else "along the flights"
    console.print(
        f"{fitted}{checked} {fit.gap_mrad:.1f} mrad, as described {fit.catalog_gap_mrad:.1f} mrad"
    )
    if not fit.is_better:
        console.print("no better than the robot as described")


def _load_world(request: FitRobotRequest, records: Sequence[FlightRecord]) -> World:
    """Load the robot into the scene in which it flew."""
    first, *others = records
    body, scene = (str(first.about.get(*each)) for each in (("body", ""), ("scene", "flat")))
    robot = load_robot(request.robot or first.robot, Body.parse(body))
    for other in others:
        if (other.about.get("body", ""), other.about.get("scene", "flat")) != (body, scene):
            raise BadInputError(
                f"flight log {other.path}: its body or scene is another than that of {first.path}"
            )
    return World(robot, load_scene(scene, robot))
