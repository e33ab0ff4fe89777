"""Rises by one planner, as pieces."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial

from humanoid_getup.benchmarks.bench_result import MeasuredRise
from humanoid_getup.benchmarks.rise import RisePiece, measure_rise
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_world, make_torque_limit
from humanoid_getup.jobs.pieces.spreading import make_worker_request, starting
from humanoid_getup.jobs.requests.bench import BenchRise
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions


def make_planner(request: BenchRise, threads: int = 0) -> PlannedRise:
    """Make the planner of a benchmark, whose physics takes a number of threads."""
    world = load_world(request)
    with refusing():
        return PlannedRise(
            world,
            torque_limit=make_torque_limit(request, world.robot),
            prefer=request.prefer,
            search_budget=request.search_budget,
            options=PlannerOptions(
                planning=request.planning,
                filtering=request.filtering,
                assistance=request.assistance,
                threads=threads,
            ),
        )


def do_rises(
    request: BenchRise,
    planner: PlannedRise,
    pieces: Mapping[str, RisePiece],
    ledger: Ledger | None,
    monitor: ProgressMonitor,
) -> dict[str, MeasuredRise]:
    """Do rises on the engine of a request; those that a ledger holds are not repeated."""
    shared = make_worker_request(BenchRise, request, ledger=None, resume=False)
    advance = monitor.count("rises", len(pieces))
    left = len(pieces.keys() - (ledger.done.keys() if ledger else ()))
    with refusing(), starting(request, left) as executor:
        return do_pieces(
            partial(measure_rise, planner) if is_here(executor) else partial(plan_rise, shared),
            pieces,
            executor,
            ledger=ledger,
            kind=MeasuredRise,
            ended=lambda *_: advance(1),
            monitor=monitor,
            robot=shared.robot,
        )


def plan_rise(request: BenchRise, piece: RisePiece) -> MeasuredRise:
    """Plan a rise and play it on the twin, in a worker."""
    return measure_rise(_get_planner(request), piece)


@lru_cache(maxsize=1)
def _get_planner(request: BenchRise) -> PlannedRise:
    """Make the planner of a worker, once."""
    return make_planner(request, threads=1)
