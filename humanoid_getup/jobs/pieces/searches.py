"""Searches for motions of several robots, as pieces that the engine of a request runs."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from uuid import uuid4

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.reports import report
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.pieces.spreading import make_worker_request, spread, starting
from humanoid_getup.jobs.requests.motions import DiscoverRequest
from humanoid_getup.jobs.search_motions import MotionSearch, NearestStand
from humanoid_getup.motions.build import UNFINISHED
from humanoid_getup.motions.motion import Motion
from humanoid_getup.posture_chains.search_file import read_simulated
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from robots import Robot


@dataclass(frozen=True, kw_only=True)
class SearchPiece:
    """The search for motions of one robot, which writes into its folder."""

    request: DiscoverRequest
    before: float | None
    """Simulated time before the budget begins to count [s]; None for a new search."""
    prefix: str
    """What its reports begin with."""
    mark: Path | None
    """File in the folder that a worker on another machine has to see; the search ends when it is
    removed."""


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
        workers = stack.enter_context(starting(request, len(robots)))
        is_here = Engine.parse(request.engine, request.address).kind == "local"
        pieces = {
            robot.name: SearchPiece(
                request=_share(robot, request),
                before=read_simulated(path)
                if (path := MotionSearch.file(robot)).exists()
                else None,
                prefix=f"{robot.name}: " if several else "",
                mark=None if is_here else stack.enter_context(_marking(robot)),
            )
            for robot in robots
        }
        work = partial(search_piece, 1 if workers.count else 0)
        # Searches write into the folders of their robots: these are no version.
        spread(work, pieces, workers, end, monitor, robot="")
    return [found[robot.name] for robot in robots]


def _share(robot: Robot, request: DiscoverRequest) -> DiscoverRequest:
    """Make the request of one robot."""
    return make_worker_request(DiscoverRequest, request, robot=str(robot.folder), picture=None)


@contextmanager
def _marking(robot: Robot) -> Iterator[Path]:
    """Mark a robot's folder while it is searched."""
    mark = robot.folder.resolve() / UNFINISHED / f"searched_{uuid4().hex}"
    mark.parent.mkdir(exist_ok=True)
    mark.touch()
    try:
        yield mark
    finally:
        mark.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # a search is kept there
            mark.parent.rmdir()


def search_piece(threads: int, piece: SearchPiece) -> SearchEnd:
    """Search for motions of a robot, in a worker.

    Raises:
        BadInputError: if the worker does not share its folder.
    """
    mark, request = piece.mark, piece.request
    if mark is not None and not mark.exists():
        raise BadInputError(
            f"{request.robot} of {platform.node()} is not the folder of this machine, expected one "
            "that all machines share: searches write into it"
        )

    def show(progress: Progress) -> None:
        field = "message" if progress.message else "phase"
        report(replace(progress, **{field: f"{piece.prefix}{getattr(progress, field)}"}))

    monitor = ProgressMonitor(show, lambda: mark is not None and not mark.exists())
    robot = load_robot(request)
    searching = MotionSearch(robot, request, monitor, before=piece.before, threads=threads)
    searching.run()
    return SearchEnd(
        motions=tuple(motion for each in searching.sides for motion in each.kept),
        wanting=searching.list_wanting(),
        nearest=searching.list_nearest(),
    )
