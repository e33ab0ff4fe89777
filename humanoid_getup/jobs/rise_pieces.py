"""Planned rises as pieces of work, which a worker does from a request alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial

from humanoid_getup.benchmarks.bench_result import MeasuredRise
from humanoid_getup.benchmarks.rise import RisePiece, RunRises, measure_rise, run_here
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_world, make_torque_limit
from humanoid_getup.jobs.requests.bench import BenchRise
from humanoid_getup.jobs.spreading import make_worker_request, spread, starting
from humanoid_getup.progress.callback import ProgressMonitor
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


def spread_rises(request: BenchRise, planner: PlannedRise, monitor: ProgressMonitor) -> RunRises:
    """Do rises on the engine of a request."""
    shared = make_worker_request(BenchRise, request, ledger=None, resume=False)

    def run(pieces: Mapping[str, RisePiece], end: Callable[[str, MeasuredRise], None]) -> None:
        with refusing(), starting(request, len(pieces)) as workers:
            if workers.count:
                spread(partial(plan_rise, shared), pieces, workers, end, monitor, shared.robot)
            else:
                run_here(planner)(pieces, end)

    return run


def plan_rise(request: BenchRise, piece: RisePiece) -> MeasuredRise:
    """Plan a rise and play it on the twin, in a worker."""
    return measure_rise(_get_planner(request), piece)


@lru_cache(maxsize=1)
def _get_planner(request: BenchRise) -> PlannedRise:
    """Make the planner of a worker, once."""
    return make_planner(request, threads=1)
