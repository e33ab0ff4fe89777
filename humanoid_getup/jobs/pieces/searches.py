"""Searches for motions of several robots, as pieces that the engine of a request runs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial

from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.pieces.shared_folder import SharedFolder, sharing
from humanoid_getup.jobs.pieces.spreading import make_worker_request, starting
from humanoid_getup.jobs.requests.motions import DiscoverRequest
from humanoid_getup.jobs.search_motions import MotionSearch, NearestStand
from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.search_file import read_simulated
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.progress.worker import report
from robots import Robot


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


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchEnd:
    """What a search found."""

    motions: tuple[Motion, ...]
    wanting: tuple[str, ...]
    """Sides without a motion."""
    nearest: tuple[NearestStand, ...]


def spread_searches(
    robots: Sequence[Robot], request: DiscoverRequest, monitor: ProgressMonitor
) -> list[SearchEnd]:
    """Search for motions of robots, for each of which `check_begin` was called.

    Raises:
        BadInputError: if a worker does not share a folder.
        CancelledError: if it is canceled; each search can be resumed.
    """
    several, found = len(robots) > 1, dict[str, SearchEnd]()

    def end(name: str, result: SearchEnd) -> None:
        found[name] = result
        if several:
            wanting = f", none from {', '.join(result.wanting)}" if result.wanting else ""
            monitor.tell(f"{name}: {len(result.motions)} motions{wanting}")

    with ExitStack() as stack:
        stack.enter_context(refusing())
        executor = stack.enter_context(starting(request, len(robots)))
        pieces = {
            robot.name: SearchPiece(
                request=_share(robot, request),
                before=read_simulated(path)
                if (path := MotionSearch.file(robot)).exists()
                else None,
                prefix=f"{robot.name}: " if several else "",
                folder=stack.enter_context(sharing(robot, request)),
            )
            for robot in robots
        }
        # Searches write into the folders of their robots: these are no version.
        work = partial(search_piece, 0 if is_here(executor) else 1)
        do_pieces(work, pieces, executor, ended=end, monitor=monitor)
    return [found[robot.name] for robot in robots]


def _share(robot: Robot, request: DiscoverRequest) -> DiscoverRequest:
    """Make the request of one robot."""
    return make_worker_request(DiscoverRequest, request, robot=str(robot.folder), picture=None)


def search_piece(threads: int, piece: SearchPiece) -> SearchEnd:
    """Search for motions of a robot, in a worker.

    Raises:
        BadInputError: if the worker does not share its folder.
    """
    request = piece.request
    piece.folder.check()

    def show(progress: Progress) -> None:
        field = "message" if progress.message else "phase"
        report(replace(progress, **{field: f"{piece.prefix}{getattr(progress, field)}"}))

    monitor = ProgressMonitor(show, piece.folder.is_released)
    robot = load_robot(request)
    searching = MotionSearch(robot, request, monitor, before=piece.before, threads=threads)
    searching.run()
    return SearchEnd(
        motions=tuple(motion for each in searching.sides for motion in each.kept),
        wanting=searching.list_wanting(),
        nearest=searching.list_nearest(),
    )
