"""Pieces of benchmarks, which a worker does from a request alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import TypeVar

from humanoid_getup.benchmarks.bench_result import MeasuredRise
from humanoid_getup.benchmarks.disturbed import DisturbedPiece, measure_disturbed
from humanoid_getup.benchmarks.fault_injection import FaultPiece, FaultTrial, play_with_fault
from humanoid_getup.benchmarks.pieces import RunPieces, one_by_one
from humanoid_getup.benchmarks.rise import HeatPiece, RisePiece, measure_method, measure_rise
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.benchmarks.scenes import ScenePiece, SceneRises
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_motion, load_robot, load_world, make_torque_limit
from humanoid_getup.jobs.requests.bench import (
    BenchDisturbed,
    BenchFaults,
    BenchMethods,
    BenchRise,
    BenchScenes,
    EngineBench,
)
from humanoid_getup.jobs.spreading import (
    make_absolute,
    make_worker_request,
    spread,
    starting,
)
from humanoid_getup.motions.motion import STANDING, Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.stand_holder import make_stand
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions

Request = TypeVar("Request", bound=EngineBench)
Piece = TypeVar("Piece")
Result = TypeVar("Result")
Names = tuple[str, ...]


def run_on_engine(
    kind: type[Request],
    request: Request,
    monitor: ProgressMonitor,
    here: Callable[[Piece], Result],
    away: Callable[[Request, Piece], Result],
    **changes: object,
) -> RunPieces[Piece, Result]:
    """Do pieces on the engine of a request.

    Args:
        kind: Class of the request in `jobs.requests.bench`.
        request: The request.
        monitor: Shows progress, and cancels.
        here: Does a piece in this process.
        away: Does the same in a worker, from the request and the piece alone.
        changes: Fields of the request as workers get them.
    """
    shared = make_worker_request(kind, request, **changes)

    def run(pieces: Mapping[str, Piece], end: Callable[[str, Result], None]) -> None:
        with refusing(), starting(request, len(pieces)) as workers:
            if workers.count:
                spread(partial(away, shared), pieces, workers, end, monitor, shared.robot)
            else:
                one_by_one(here)(pieces, end)

    return run


def _rename_policy(rises: list[MeasuredRise], files: Names, names: Names) -> list[MeasuredRise]:
    """Name policies as they were given, where a worker has them by the paths of their files."""
    given = dict(zip(files, names, strict=True))
    return [
        rise if rise.policy is None else replace(rise, policy=given.get(rise.policy, rise.policy))
        for rise in rises
    ]


# Rises by one planner ---------------------------------------------------------------------------


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


def spread_rises(
    request: BenchRise, planner: PlannedRise, monitor: ProgressMonitor
) -> RunPieces[RisePiece, MeasuredRise]:
    """Do rises on the engine of a request."""
    here = partial(measure_rise, planner)
    return run_on_engine(BenchRise, request, monitor, here, plan_rise, ledger=None, resume=False)


def plan_rise(request: BenchRise, piece: RisePiece) -> MeasuredRise:
    """Plan a rise and play it on the twin, in a worker."""
    return measure_rise(_get_planner(request), piece)


@lru_cache(maxsize=1)
def _get_planner(request: BenchRise) -> PlannedRise:
    """Make the planner of a worker, once."""
    return make_planner(request, threads=1)


# Several methods --------------------------------------------------------------------------------


def make_methods(request: BenchMethods, names: Names) -> dict[str, Strategy]:
    """Make the strategies that a benchmark compares, by the names that they were given."""
    world = load_world(request)
    limit = make_torque_limit(request, world.robot)
    with refusing():
        database = load_database(world.robot)
        return {
            name: make_strategy(world, way, torque_limit=limit, database=database)
            for name, way in zip(names, request.ways, strict=True)
        }


def spread_methods(
    request: BenchMethods, strategies: Mapping[str, Strategy], monitor: ProgressMonitor
) -> RunPieces[RisePiece | HeatPiece, MeasuredRise | float]:
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
        return _rename_policy([found], request.ways, names)[0]
    return found


_get_methods = lru_cache(maxsize=1)(make_methods)


# Disturbed worlds -------------------------------------------------------------------------------


def make_disturbed(
    request: BenchDisturbed, names: Names
) -> tuple[PlannedRise, dict[str, Strategy]]:
    """Make the planner of a benchmark, and its policies by the names that they were given."""
    world = load_world(request)
    limit = make_torque_limit(request, world.robot)
    with refusing():
        policies = {
            name: make_strategy(world, way, torque_limit=limit)
            for name, way in zip(names, request.policies, strict=True)
            if name
        }
        return PlannedRise(world, load_database(world.robot), torque_limit=limit), policies


def spread_disturbed(
    request: BenchDisturbed,
    planner: PlannedRise,
    policies: Mapping[str, Strategy],
    monitor: ProgressMonitor,
) -> RunPieces[DisturbedPiece, list[MeasuredRise]]:
    """Do the rises in disturbed worlds on the engine of a request."""
    here = partial(measure_disturbed, planner, policies)
    away = partial(rise_disturbed, request.policies)
    absolute = tuple(map(make_absolute, request.policies))
    return run_on_engine(BenchDisturbed, request, monitor, here, away, policies=absolute)


def rise_disturbed(
    names: Names, request: BenchDisturbed, piece: DisturbedPiece
) -> list[MeasuredRise]:
    """Rise in every disturbed world, in a worker."""
    found = measure_disturbed(*_get_disturbed(request, names), piece)
    return _rename_policy(found, request.policies, names)


_get_disturbed = lru_cache(maxsize=1)(make_disturbed)


# Scenes -----------------------------------------------------------------------------------------


def make_scene_rises(request: BenchScenes, names: Names) -> SceneRises:
    """Prepare the rises in scenes, by methods under the names that they were given."""
    with refusing():
        robot = load_robot(request)
        database = load_database(robot)
    methods = [
        replace(RiseMethod.of(way, database), name=name)
        for name, way in zip(names, request.ways, strict=True)
    ]
    return SceneRises(robot, methods, make_torque_limit(request, robot))


def spread_scenes(
    request: BenchScenes, rises: SceneRises, monitor: ProgressMonitor
) -> RunPieces[ScenePiece, list[MeasuredRise]]:
    """Do the rises in scenes on the engine of a request."""
    sources = {scene: make_absolute(scene) for scene in request.scenes}
    away = partial(rise_in_scene, request.ways, sources)
    ways = tuple(map(make_absolute, request.ways))
    return run_on_engine(BenchScenes, request, monitor, rises.measure, away, ways=ways, scenes=())


def rise_in_scene(
    names: Names, sources: Mapping[str, str], request: BenchScenes, piece: ScenePiece
) -> list[MeasuredRise]:
    """Rise in a scene by every method, in a worker."""
    source = sources.get(piece.scene, piece.scene)
    found = _get_scene_rises(request, names).measure(replace(piece, scene=source))
    renamed = _rename_policy(found, request.ways, names)
    return [replace(rise, case=piece.scene) for rise in renamed]


_get_scene_rises = lru_cache(maxsize=1)(make_scene_rises)


# Faults -----------------------------------------------------------------------------------------


def load_played(request: BenchFaults) -> tuple[World, Motion]:
    """Load the world of a benchmark, and the motion that is played, or a stand."""
    world = load_world(request)
    robot, is_stand = world.robot, request.motion == STANDING
    return world, make_stand(robot) if is_stand else find_motion(robot, request.motion)


def spread_faults(
    request: BenchFaults, world: World, motion: Motion, monitor: ProgressMonitor
) -> RunPieces[FaultPiece, FaultTrial]:
    """Play with faults on the engine of a request."""
    here, chosen = partial(play_with_fault, world, motion), make_absolute(request.motion)
    return run_on_engine(BenchFaults, request, monitor, here, inject_fault, motion=chosen)


def inject_fault(request: BenchFaults, piece: FaultPiece) -> FaultTrial:
    """Play with a fault, in a worker."""
    return play_with_fault(*_get_played(request), piece)


_get_played = lru_cache(maxsize=1)(load_played)
