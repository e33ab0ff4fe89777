"""Rises from many settled falls, by plans."""

from __future__ import annotations

from msgspec.structs import replace

from humanoid_getup.benchmarks.bench_result import RiseBench
from humanoid_getup.benchmarks.rise import bench_rise
from humanoid_getup.engines.versions import Versions
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.pieces.planned_rises import do_rises, make_planner
from humanoid_getup.jobs.requests.bench import BenchRise
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.strategies.fingerprint import compute_fingerprint
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Body


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
    with refusing():
        ledger = _open_ledger(request, planner)
    if ledger is not None and ledger.done:
        monitor.tell(f"{len(ledger.done)} rises are finished")
    result = bench_rise(
        planner,
        seed=request.seed,
        each=request.n,
        do=lambda pieces: do_rises(request, planner, pieces, ledger, monitor),
    )
    body = str(Body.parse(request.body))
    return replace(result, body=body, versions=Versions.find(request.robot))


def _open_ledger(request: BenchRise, planner: PlannedRise) -> Ledger | None:
    """Open the ledger of a request, if it names one.

    Raises:
        ValueError: if it is damaged, or that of another benchmark.
    """
    if request.ledger is None:
        return None
    recipe = {
        "plans": compute_fingerprint(planner),
        "torque_limit_nm": planner.torque_limit.value,
        "limit_by": planner.torque_limit.by,
        "prefer": planner.prefer,
        "seed": request.seed,
        "n": request.n,
        "versions": Versions.find(request.robot),
    }
    start = Ledger.resume if request.resume else Ledger
    return start(request.ledger, recipe)
