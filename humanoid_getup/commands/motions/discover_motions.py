"""`getup motions discover`: motions by a search in physics, or of the rises of a policy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, BadInputError, refusing
from humanoid_getup.commands.files import PICTURE, READ, ROBOT
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.motions.build_motions import check_folders
from humanoid_getup.commands.motions.search_motions import (
    MotionSearch,
    NearestStand,
    check_begin,
)
from humanoid_getup.commands.options import (
    Count,
    EngineOptions,
    RobotOption,
    Seed,
    TorqueLimitValue,
    write_command,
)
from humanoid_getup.commands.output_files import check_file
from humanoid_getup.commands.pieces import SharedFolder, make_worker_request, sharing, starting
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import checked
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import name_robot
from humanoid_getup.posture_chains.search_file import read_simulated
from humanoid_getup.progress.callback import Cancel, Progress, ProgressMonitor, Report
from humanoid_getup.progress.worker import report
from humanoid_getup.reporting.film_strip import NoRendererError, PostureRow, draw_motions
from robots import Robot
from robots.storage.validation import at_least, between

DEFAULT_ROBOT = "op3"


@dataclass(frozen=True, kw_only=True)
class DiscoverRequest(EngineOptions, RobotOption):
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
    robot: Annotated[str, ROBOT, arg(metavar="NAME|DIR,...")] = ""
    """Names of robots, or folders with a robot.toml; the engine runs one search for each. Default:
    op3, or the policy file's robot."""
    sides: Annotated[tuple[str, ...], arg(metavar="SIDE,...")] = ()
    """Sides from which motions are searched: supine, prone, left; those from the right mirror
    those from the left, unless a limp joint makes them differ; default: all."""
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

    @property
    def robots(self) -> tuple[str, ...]:
        """Return the robots."""
        return tuple(self.robot.split(","))

    def find_problems(self) -> list[str]:
        """Report options of a search with a policy, and the reverse, as well."""
        problems = super().find_problems()
        if len(self.robots) > 1 and self.picture is not None:
            problems.append("--picture is given, expected none with several robots")
        if len(self.robots) > 1 and self.policy:
            problems.append(f"--robot is {self.robot}, expected one with a policy")
        of_search = {
            "--budget": self.budget,
            "--resume": self.resume or None,
            "--torque-limit": self.torque_limit,
            "--engine": None if self.engine == EngineOptions.engine else self.engine,
        }
        wrong, state = (of_search, "with") if self.policy else ({"--rises": self.rises}, "without")
        given = [name for name, value in wrong.items() if value is not None]
        return problems + [f"{name} is given, expected none {state} a policy" for name in given]


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
    robots = [load_robot(each) for each in _split(request)]
    return not request.policy and any(MotionSearch.file(robot).exists() for robot in robots)


@command("motions discover", is_begun=is_begun)
def discover_all(
    request: DiscoverRequest, monitor: ProgressMonitor
) -> tuple[DiscoveredMotions, ...]:
    """Find motions of robots from each side, and store them with their keys and a picture."""
    if request.policy:
        monitor.begin("loading")
        from humanoid_getup.commands.motions.harvest_policy import harvest_policy  # slow to import

        found = (harvest_policy(request, monitor),)
    else:
        found = _search(request, monitor)
    monitor.begin("drawing")
    return tuple(_draw(each, request) for each in found)


@discover_all.show
def _print(found: tuple[DiscoveredMotions, ...], request: DiscoverRequest, console: Console) -> int:
    for each in found:
        if len(found) > 1:
            console.print(f"{each.robot.name}:", markup=False)
        for line in _tell(each, request):
            console.print(line, markup=False, soft_wrap=True)
    return DID_NOT_STAND if any(each.wanting for each in found) else DID_IT


def discover(
    request: DiscoverRequest, report: Report | None = None, cancel: Cancel | None = None
) -> DiscoveredMotions:
    """Find motions of one robot, as `discover_all` does for several."""
    if len(request.robots) > 1:
        raise BadInputError(f"robot is {request.robot}, expected one: discover_all takes several")
    (found,) = discover_all(request, report, cancel)
    return found


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


def _split(request: DiscoverRequest) -> list[DiscoverRequest]:
    """Return a request for each robot."""
    return [replace(request, robot=robot or DEFAULT_ROBOT) for robot in request.robots]


def _search(request: DiscoverRequest, monitor: ProgressMonitor) -> tuple[DiscoveredMotions, ...]:
    """Search in physics."""
    robots = [load_robot(each) for each in _split(request)]
    if twice := sorted({a.name for a in robots if [b.name for b in robots].count(a.name) > 1}):
        raise BadInputError(f"--robot has {twice[0]} twice, expected robots of different names")
    robots = [robot for robot in robots if _is_searched(robot, request, monitor)]
    return spread_searches(robots, request, monitor)


def _is_searched(robot: Robot, request: DiscoverRequest, monitor: ProgressMonitor) -> bool:
    """Check that a search can begin; return whether it has to, when several are resumed."""
    check_files(robot, request)
    begun = MotionSearch.file(robot).exists()
    if not request.resume or begun or len(request.robots) == 1:
        check_begin(robot, request)
        return True
    try:
        check_begin(robot, replace(request, resume=False))
    except ValueError as error:
        monitor.tell(f"{robot.name}: {error}")
        return False
    return True


def _draw(found: DiscoveredMotions, request: DiscoverRequest) -> DiscoveredMotions:
    """Draw what was found, if there is a GL to draw with."""
    picture = _find_picture(found.robot, request)
    rows = [PostureRow(name=f"{each.side}, not kept", qpos=each.qpos) for each in found.nearest]
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


@dataclass(frozen=True, kw_only=True)
class SearchPiece:
    """The search for motions of one robot, which writes into its folder."""

    request: DiscoverRequest
    before: float | None
    """Simulated time before the budget begins to count [s]; None for a new search."""
    prefix: str
    """What its reports begin with."""
    folder: SharedFolder
    """The search ends when it is released."""


def spread_searches(
    robots: Sequence[Robot], request: DiscoverRequest, monitor: ProgressMonitor
) -> tuple[DiscoveredMotions, ...]:
    """Search for motions of robots, for each of which `check_begin` was called."""
    several = len(robots) > 1

    def end(name: str, result: DiscoveredMotions) -> None:
        if several:
            wanting = f", none from {', '.join(result.wanting)}" if result.wanting else ""
            monitor.tell(f"{name}: {len(result.motions)} motions{wanting}")

    with ExitStack() as stack:
        stack.enter_context(refusing())
        executor = stack.enter_context(starting(request, len(robots)))
        pieces = {
            robot.name: SearchPiece(
                request=make_worker_request(
                    DiscoverRequest, request, robot=str(robot.folder), picture=None
                ),
                before=read_simulated(path)
                if (path := MotionSearch.file(robot)).exists()
                else None,
                prefix=f"{robot.name}: " if several else "",
                folder=stack.enter_context(sharing(robot, request)),
            )
            for robot in robots
        }
        # Searches write into the folders of their robots: these are no version.
        work = checked(partial(search_piece, 0 if is_here(executor) else 1), executor)
        return tuple(do_pieces(work, pieces, executor, ended=end, monitor=monitor).values())


def search_piece(threads: int, piece: SearchPiece) -> DiscoveredMotions:
    """Search for motions of a robot, in a worker."""
    request = piece.request
    piece.folder.check()

    def show(progress: Progress) -> None:
        field = "message" if progress.message else "phase"
        report(replace(progress, **{field: f"{piece.prefix}{getattr(progress, field)}"}))

    monitor = ProgressMonitor(show, piece.folder.is_released)
    robot = load_robot(request)
    searching = MotionSearch(robot, request, monitor, before=piece.before, threads=threads)
    searching.run()
    return DiscoveredMotions(
        robot=robot,
        motions=tuple(motion for each in searching.sides for motion in each.kept),
        wanting=searching.list_wanting(),
        nearest=searching.list_nearest(),
        goes_on=MotionSearch.file(robot).exists(),
    )
