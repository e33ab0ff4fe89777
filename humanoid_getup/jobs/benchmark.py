"""Rises from many settled falls, by plans."""

from __future__ import annotations

import hashlib
from functools import lru_cache, partial

import numpy as np

from humanoid_getup.benchmarks.rise import (
    BENCH_CLASSES,
    MeasuredRise,
    RiseBench,
    RisePiece,
    list_pieces,
    measure_rise,
    summarize_classes,
)
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import load_world, make_torque_limit
from humanoid_getup.commands.pieces import make_worker_request, starting
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import Versions
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.jobs.requests.bench import BenchRise
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions


def benchmark(
    request: BenchRise, report: Report | None = None, cancel: Cancel | None = None
) -> RiseBench:
    """Rise from many settled falls.

    Raises:
        BadInputError: if something that it names cannot be used.
        CancelledError: if ``cancel`` ended it; the rises that were finished are in its ledger.
    """
    BenchRise.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    planner = make_planner(request)
    world, limit = planner.world, planner.torque_limit
    with refusing():
        ledger = _open_ledger(request, planner)
        rng = np.random.default_rng(request.seed)
        falls = sample_falls(world, dict.fromkeys(BENCH_CLASSES, request.n), rng)
    # An unfiltered path is played to see whether it stands.
    pieces = list_pieces(falls, request.seed, preflight=request.filtering)
    if ledger is not None and ledger.done:
        monitor.tell(f"{len(ledger.done)} rises are finished")
    advance = monitor.count("rises", len(pieces))
    shared = make_worker_request(BenchRise, request, ledger=None, resume=False)
    left = len(pieces.keys() - (ledger.done.keys() if ledger else ()))
    with refusing(), starting(request, left) as executor:
        found = do_pieces(
            partial(measure_rise, planner) if is_here(executor) else partial(plan_rise, shared),
            pieces,
            executor,
            ledger=ledger,
            kind=MeasuredRise,
            ended=lambda *_: advance(1),
            monitor=monitor,
            robot=shared.robot,
        )
    rises = [*found.values()]
    return RiseBench(
        seed=request.seed,
        n=len(rises),
        robot=world.robot.name,
        body=str(world.robot.body),
        scene=world.scene.name,
        torque_limit_nm=limit.value,
        limit_by=limit.by,
        versions=Versions.find(request.robot),
        planning=request.planning,
        filtering=request.filtering,
        assistance=request.assistance,
        prefer=planner.prefer,
        search_budget_s=planner.search_budget,
        classes=summarize_classes(rises, BENCH_CLASSES),
        all=RiseSummary.of(rises),
        rises=rises,
    )


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


def plan_rise(request: BenchRise, piece: RisePiece) -> MeasuredRise:
    """Plan a rise and play it on the twin, in a worker."""
    return measure_rise(_get_planner(request), piece)


_get_planner = lru_cache(maxsize=1)(partial(make_planner, threads=1))


def _open_ledger(request: BenchRise, planner: PlannedRise) -> Ledger | None:
    """Open the ledger of a request, if it names one."""
    if request.ledger is None:
        return None
    recipe = {
        "world": hashlib.sha256(planner.world.content).hexdigest(),
        "torque_limit_nm": planner.torque_limit.value,
        "limit_by": planner.torque_limit.by,
        "planning": request.planning,
        "filtering": request.filtering,
        "assistance": request.assistance,
        "prefer": request.prefer,
        "search_budget_s": request.search_budget,
        "seed": request.seed,
        "n": request.n,
        "versions": Versions.find(request.robot),
    }
    start = Ledger.resume if request.resume else Ledger
    return start(request.ledger, recipe)
