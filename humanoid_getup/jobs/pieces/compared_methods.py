"""Rises by several methods from the same falls, as pieces."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial

from humanoid_getup.benchmarks.bench_result import MeasuredRise
from humanoid_getup.benchmarks.rise import HeatPiece, RisePiece, RunMethods, measure_method
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_world, make_torque_limit
from humanoid_getup.jobs.pieces.named_policies import Names, rename_policies
from humanoid_getup.jobs.pieces.spreading import make_absolute, run_on_engine
from humanoid_getup.jobs.requests.bench import BenchMethods
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.plan import Strategy


def make_methods(request: BenchMethods, names: Names, threads: int = 0) -> dict[str, Strategy]:
    """Make the strategies that a benchmark compares, by the names that they were given."""
    world = load_world(request)
    limit = make_torque_limit(request, world.robot)
    with refusing():
        database = load_database(world.robot)
        return {
            name: make_strategy(world, way, torque_limit=limit, database=database, threads=threads)
            for name, way in zip(names, request.ways, strict=True)
        }


def spread_methods(
    request: BenchMethods, strategies: Mapping[str, Strategy], monitor: ProgressMonitor
) -> RunMethods:
    """Do the rises of several methods on the engine of a request."""
    here, away = partial(measure_method, strategies), partial(rise_by_method, request.ways)
    ways = tuple(map(make_absolute, request.ways))
    return run_on_engine(BenchMethods, request, monitor, here, away, ways=ways)


def rise_by_method(
    names: Names, request: BenchMethods, piece: RisePiece | HeatPiece
) -> MeasuredRise | float:
    """Rise by one of several methods, in a worker."""
    found = measure_method(_get_methods(request, names), piece)
    if isinstance(found, MeasuredRise):
        return rename_policies([found], request.ways, names)[0]
    return found


@lru_cache(maxsize=1)
def _get_methods(request: BenchMethods, names: Names) -> dict[str, Strategy]:
    """Make the strategies of a worker, once."""
    return make_methods(request, names, threads=1)
