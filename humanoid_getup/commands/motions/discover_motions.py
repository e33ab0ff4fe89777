"""`getup motions discover`: motions by a search in physics, or of the rises of a policy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, refusing
from humanoid_getup.commands.files import PICTURE, READ, ROBOT, check_file
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.motions.build_motions import check_folders
from humanoid_getup.commands.motions.search_motions import (
    MotionSearch,
    NearestStand,
    check_begin,
)
from humanoid_getup.commands.options import (
    Count,
    RobotOption,
    Seed,
    TorqueLimitValue,
    write_command,
)
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import name_robot
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.film_strip import NoRendererError, draw_motions
from robots import Robot
from robots.storage.validation import at_least, between

DEFAULT_ROBOT = "op3"


@dataclass(frozen=True, kw_only=True)
class DiscoverRequest(RobotOption):
    """Find motions of a robot that has none: search in physics how it gets up from each side.

    From lying, the servos' targets move from one posture in which the robot rests to the next,
    until it stands. With a policy, its rises become motions instead: replayed without feedback,
    as smooth as they still stand. Either way, what stands in few disturbed worlds is not kept.
    """

    policy: Annotated[
        Positional[str],
        READ,
        arg(
            metavar="POLICY",
            help="Name of a policy of the robot, or an .onnx file, whose rises become motions; "
            "default: none, a search.",
        ),
    ] = ""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: op3, or the policy file's robot."""
    sides: Annotated[tuple[str, ...], arg(metavar="SIDE,...")] = ()
    """Sides from which motions are searched: supine, prone, left; those from the right mirror
    those from the left, unless a limp joint makes them differ; default: all."""
    through: Annotated[str | None, READ, arg(metavar="half-kneel|FILE|motions:NAME@TIME")] = None
    """Posture in which the robot rests on the way, and from which it gets up: one foot and the
    other knee on the ground, a posture file, or a frame of a motion."""
    most: Count = 2
    """Motions from each side, of different ways up."""
    budget: Annotated[float | None, between(1.0, 1e9, "s"), arg(metavar="S")] = None
    """Simulated time for a search [s], after which the round that has begun is finished; default:
    300,000 s."""
    torque_limit: TorqueLimitValue = None
    resume: bool = False
    """Go on with the search that ended or was interrupted, for another budget."""
    rises: Annotated[int | None, at_least(2)] = None
    """Rises of a policy from each side; default: 48."""
    seed: Seed = 0
    picture: Annotated[Path | None, PICTURE, arg(metavar="FILE.png")] = None
    """Picture of the motions to write; default: ROBOT_motions.png."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        of_search = {
            "--budget": self.budget,
            "--resume": self.resume or None,
            "--through": self.through,
            "--torque-limit": self.torque_limit,
        }
        wrong, state = (of_search, "with") if self.policy else ({"--rises": self.rises}, "without")
        given = [name for name, value in wrong.items() if value is not None]
        yield from (f"{name} is given, expected none {state} a policy" for name in given)


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscoveredMotions:
    """Motions that were found, and what could not be."""

    robot: Robot
    motions: tuple[Motion, ...]
    wanting: tuple[str, ...]
    """Sides without a motion."""
    nearest: tuple[NearestStand, ...] = ()
    """How near to a stand a search came from them."""
    goes_on: bool
    """Whether a search can go on from where it ended."""
    picture: Path | None = None
    """Film strips of all motions, and of what came nearest to a stand; None without either, or
    with nothing to draw with."""


def is_begun(request: DiscoverRequest) -> bool:
    """Tell whether there is a search to resume."""
    return not request.policy and MotionSearch.file(_load_robot(request)).exists()


@command("motions discover", is_begun=is_begun)
def discover(request: DiscoverRequest, monitor: ProgressMonitor) -> DiscoveredMotions:
    """Find motions of a robot from each side, and store them with their keys and a picture."""
    if request.policy:
        monitor.begin("loading")
        from humanoid_getup.commands.motions.harvest_policy import harvest_policy  # slow to import

        found = harvest_policy(request, monitor)
    else:
        found = _search(request, monitor)
    monitor.begin("drawing")
    return _draw(found, request)


@discover.show
def _print(found: DiscoveredMotions, request: DiscoverRequest, console: Console) -> int:
    for line in _tell(found, request):
        console.print(line, markup=False, soft_wrap=True)
    return DID_NOT_STAND if found.wanting else DID_IT


def _tell(found: DiscoveredMotions, request: DiscoverRequest) -> Iterator[str]:
    """Yield the picture, what was not found, and the command to go on with."""
    if found.picture is not None:
        yield f"film strips in {found.picture}"
    if found.wanting:
        yield f"no motion from: {', '.join(found.wanting)}"
    yield from (each.describe() for each in found.nearest)
    if found.wanting and found.goes_on:
        yield f"next: {write_command('motions discover', replace(request, resume=True))}"
    elif found.motions:
        start = found.motions[0].start_class
        yield f"next: getup rise {name_robot(found.robot)} --from {start}"


def _load_robot(request: DiscoverRequest) -> Robot:
    return load_robot(replace(request, robot=request.robot or DEFAULT_ROBOT))


def _search(request: DiscoverRequest, monitor: ProgressMonitor) -> DiscoveredMotions:
    """Search in physics."""
    robot = _load_robot(request)
    check_files(robot, request)
    check_begin(robot, request)
    with refusing():
        searching = MotionSearch(robot, request, monitor)
        searching.run()
    return DiscoveredMotions(
        robot=robot,
        motions=tuple(motion for each in searching.sides for motion in each.kept),
        wanting=searching.list_wanting(),
        nearest=searching.list_nearest(),
        goes_on=MotionSearch.file(robot).exists(),
    )


def _draw(found: DiscoveredMotions, request: DiscoverRequest) -> DiscoveredMotions:
    """Draw what was found, if there is a GL to draw with."""
    picture = _find_picture(found.robot, request)
    rows = [(f"{each.side}, not kept", each.qpos) for each in found.nearest]
    if not found.motions and not rows:
        return found
    try:
        draw_motions(found.robot, found.motions, picture, rows)
    except NoRendererError:
        return found
    return replace(found, picture=picture)


def _find_picture(robot: Robot, request: DiscoverRequest) -> Path:
    return request.picture or Path(f"{robot.name}_motions.png")


def check_files(robot: Robot, request: DiscoverRequest) -> None:
    """Refuse what cannot be written."""
    check_folders(robot)
    check_file(_find_picture(robot, request))
