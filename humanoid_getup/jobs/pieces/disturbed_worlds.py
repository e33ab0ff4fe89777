"""Rises in disturbed worlds, as pieces."""

from __future__ import annotations

from functools import lru_cache, partial

from humanoid_getup.benchmarks.bench_result import MeasuredRise
from humanoid_getup.benchmarks.disturbed import DisturbedPiece, DisturbedWays, RunDisturbed
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_world, make_torque_limit
from humanoid_getup.jobs.pieces.named_policies import Names, rename_policies
from humanoid_getup.jobs.pieces.spreading import make_absolute, run_on_engine
from humanoid_getup.jobs.requests.bench import BenchDisturbed
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions


def make_disturbed(request: BenchDisturbed, names: Names, threads: int = 0) -> DisturbedWays:
    """Make the planner of a benchmark, and its policies by the names that they were given."""
    world = load_world(request)
    limit = make_torque_limit(request, world.robot)
    options = PlannerOptions(threads=threads)
    with refusing():
        policies = {
            name: make_strategy(world, way, torque_limit=limit)
            for name, way in zip(names, request.policies, strict=True)
            if name
        }
        database = load_database(world.robot)
        planner = PlannedRise(world, database, torque_limit=limit, options=options)
    return DisturbedWays(planner=planner, policies=policies)


def spread_disturbed(
    request: BenchDisturbed, ways: DisturbedWays, monitor: ProgressMonitor
) -> RunDisturbed:
    """Do the rises in disturbed worlds on the engine of a request."""
    away = partial(rise_disturbed, request.policies)
    policies = tuple(map(make_absolute, request.policies))
    return run_on_engine(BenchDisturbed, request, monitor, ways.measure, away, policies=policies)


def rise_disturbed(
    names: Names, request: BenchDisturbed, piece: DisturbedPiece
) -> list[MeasuredRise]:
    """Rise in every disturbed world, in a worker."""
    found = _get_disturbed(request, names).measure(piece)
    return rename_policies(found, request.policies, names)


@lru_cache(maxsize=1)
def _get_disturbed(request: BenchDisturbed, names: Names) -> DisturbedWays:
    """Make the ways of a worker, once."""
    return make_disturbed(request, names, threads=1)
