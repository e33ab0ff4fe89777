"""Runs a benchmark on the twin or on the virtual bus."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from msgspec.structs import replace

from humanoid_getup.benchmarks import (
    disturbed,
    fault_injection,
    motions,
    rise,
    scenes,
    sit,
    soak,
    speed,
)
from humanoid_getup.benchmarks.bench_result import BenchHead
from humanoid_getup.engines.versions import Versions
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_motion, load_robot, load_world
from humanoid_getup.jobs.measure_bodies import measure_bodies
from humanoid_getup.jobs.measure_robot import measure_robot
from humanoid_getup.jobs.pieces.compared_methods import make_methods, spread_methods
from humanoid_getup.jobs.pieces.disturbed_stands import spread_sits
from humanoid_getup.jobs.pieces.disturbed_worlds import make_disturbed, spread_disturbed
from humanoid_getup.jobs.pieces.injected_faults import load_played, spread_faults
from humanoid_getup.jobs.pieces.planned_rises import make_planner, spread_rises
from humanoid_getup.jobs.pieces.played_motions import spread_motions
from humanoid_getup.jobs.pieces.rises_in_scenes import make_scene_rises, spread_scenes
from humanoid_getup.jobs.policies import load_policy
from humanoid_getup.jobs.requests.bench import (
    BenchAll,
    BenchBodies,
    BenchDisturbed,
    BenchFaults,
    BenchFilter,
    BenchKill,
    BenchMethods,
    BenchMotions,
    BenchRise,
    BenchScenes,
    BenchSit,
    BenchSoak,
)
from humanoid_getup.jobs.requests.shared import BodyOption, JobRequest, SceneOptions, accept_kind
from humanoid_getup.motions.motion import MIRRORED_SUFFIX
from humanoid_getup.motions.motion_database import MotionDatabase, find_lying_down, load_database
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.cached_rise import compute_fingerprint
from humanoid_getup.strategies.choice import NEAREST, STRAIGHT
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.track_record import PLAN
from robots import Body


def benchmark(
    request: JobRequest, report: Report | None = None, cancel: Cancel | None = None
) -> BenchHead:
    """Run the benchmark of a request of `jobs.requests.bench`.

    Raises:
        BadInputError: if something that it names cannot be used.
        CancelledError: if ``cancel`` ended it; `BenchAll` and `BenchBodies` keep the parts that
            were finished, `BenchRise` keeps the rises in its ledger.
    """
    if isinstance(request, BenchAll):
        result = measure_robot(request, report, cancel)
    elif isinstance(request, BenchBodies):
        result = measure_bodies(request, report, cancel)
    else:
        accept_kind(request, BenchAll, BenchBodies, *BENCHMARKS).check()
        monitor = ProgressMonitor(report, cancel)
        monitor.begin("loading")
        run = next(run for kind, run in BENCHMARKS.items() if isinstance(request, kind))
        result = run(request, monitor)
    if isinstance(request, BodyOption):
        return replace(result, body=str(Body.parse(request.body)))
    return result


def _bench_rise(request: BenchRise, monitor: ProgressMonitor) -> BenchHead:
    """Rise from many settled falls."""
    planner = make_planner(request)
    with refusing():
        ledger = _open_ledger(request, planner)
    if ledger is not None and ledger.done:
        monitor.tell(f"{len(ledger.done)} rises are finished")
    rises = len(rise.BENCH_CLASSES) * request.n
    run = spread_rises(request, planner, monitor)
    bench = partial(rise.bench_rise, planner, ledger=ledger, run=run)
    result = _count(request, monitor, bench, count=rises, of="rises")
    return replace(result, versions=Versions.find(request.robot))


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


def _bench_methods(request: BenchMethods, monitor: ProgressMonitor) -> BenchHead:
    """Compare plans and policies on the same falls."""
    strategies = make_methods(request, request.ways)
    run = spread_methods(request, strategies, monitor)
    bench = partial(rise.bench_methods, strategies, run=run)
    rises = len(rise.BENCH_CLASSES) * request.n * len(strategies)
    return _count(request, monitor, bench, count=rises, of="rises")


def _bench_disturbed(request: BenchDisturbed, monitor: ProgressMonitor) -> BenchHead:
    """Compare plans, with and without feedback, and policies in disturbed worlds."""
    with refusing():
        cases = disturbed.select(load_robot(request), request.cases)
    ways = make_disturbed(request, request.policies)
    run = spread_disturbed(request, ways, monitor)
    bench = partial(disturbed.bench_disturbed, ways, cases=cases, run=run)
    rises = len(cases) * len(ways.names) * len(rise.BENCH_CLASSES) * request.n
    return _count(request, monitor, bench, count=rises, of="rises")


def _bench_scenes(request: BenchScenes, monitor: ProgressMonitor) -> BenchHead:
    """Compare plans, policies and stored motions in every scene."""
    names = request.scenes or scenes.SCENES
    with refusing():
        robot = load_robot(request)
        for name in names:
            load_scene(name, robot, request.seed)
    for name in request.ways:
        if name not in (PLAN, NEAREST, STRAIGHT):  # refuses a policy that does not fit
            load_policy(robot, name, request.torque_limit)
    rises = make_scene_rises(request, request.ways)
    run = spread_scenes(request, rises, monitor)
    bench = partial(scenes.bench_scenes, robot, rises, scenes=names, run=run)
    count = len(names) * len(request.ways) * request.n
    return _count(request, monitor, bench, count=count, of="rises")


def _bench_motions(request: BenchMotions, monitor: ProgressMonitor) -> BenchHead:
    """Play every stored motion, undisturbed and disturbed."""
    world, database = _load(request)
    own = [m for m in database.motions if not m.name.endswith(MIRRORED_SUFFIX)]
    run = spread_motions(request, world, monitor)
    bench = partial(motions.bench_motions, world, own, run=run)
    return _count(request, monitor, bench, count=len(own), of="motions")


def _bench_sit(request: BenchSit, monitor: ProgressMonitor) -> BenchHead:
    """Sit and lie down from many disturbed stands."""
    world = load_world(request)
    with refusing():
        find_lying_down(world.robot)
    bench = partial(sit.bench_sit, world, run=spread_sits(request, world, monitor))
    return _count(request, monitor, bench, count=request.n * len(sit.LIMITS), of="stands")


def _bench_filter(request: BenchFilter, monitor: ProgressMonitor) -> BenchHead:
    """Compare the speed of the filter's simulation with bare physics."""
    world, database = _load(request)
    monitor.begin("filtering")
    return speed.bench_filter(world, database, seed=request.seed, repeats=request.n)


def _bench_faults(request: BenchFaults, monitor: ProgressMonitor) -> BenchHead:
    """Inject each kind of fault in the middle of a motion, or of a held stand."""
    world, motion = load_played(request)
    run = spread_faults(request, world, motion, monitor)
    bench = partial(fault_injection.bench_faults, world, motion, run=run)
    plays = len(fault_injection.CASES) * request.n
    return _count(request, monitor, bench, count=plays, of="plays")


def _bench_kill(request: BenchKill, monitor: ProgressMonitor) -> BenchHead:
    """Kill the program in the middle of a rise."""
    world = load_world(request)
    motion = find_motion(world.robot, request.motion)
    return _count(
        request, monitor, fault_injection.bench_kill, world, motion, count=request.n, of="kills"
    )


def _bench_soak(request: BenchSoak, monitor: ProgressMonitor) -> BenchHead:
    """Rise, hold, lie down, tumble and rise again for a time on the bus."""
    planner = PlannedRise(*_load(request))
    count = monitor.count("bus time [s]", round(request.duration))
    return soak.bench_soak(planner, seed=request.seed, duration=request.duration, report=count)


BENCHMARKS: dict[type[JobRequest], Callable[[Any, ProgressMonitor], BenchHead]] = {
    BenchRise: _bench_rise,
    BenchMethods: _bench_methods,
    BenchDisturbed: _bench_disturbed,
    BenchScenes: _bench_scenes,
    BenchMotions: _bench_motions,
    BenchSit: _bench_sit,
    BenchFilter: _bench_filter,
    BenchFaults: _bench_faults,
    BenchKill: _bench_kill,
    BenchSoak: _bench_soak,
}
"""Function of each request."""


def _count(
    request: Any,
    monitor: ProgressMonitor,
    bench: Callable[..., BenchHead],
    *subjects: Any,
    count: int,
    of: str,
) -> BenchHead:
    """Run a benchmark that reports each of a number of steps."""
    advance = monitor.count(of, count)
    return bench(*subjects, seed=request.seed, each=request.n, report=lambda _: advance(1))


def _load(request: SceneOptions) -> tuple[World, MotionDatabase]:
    world = load_world(request)
    with refusing():
        return world, load_database(world.robot)
