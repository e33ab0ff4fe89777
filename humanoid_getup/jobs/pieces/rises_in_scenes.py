"""Rises in scenes, as pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache, partial

from humanoid_getup.benchmarks.bench_result import MeasuredRise
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.benchmarks.scenes import RunScenes, ScenePiece, SceneRises
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_robot, make_torque_limit
from humanoid_getup.jobs.pieces.named_policies import Names, rename_policies
from humanoid_getup.jobs.pieces.spreading import make_absolute, run_on_engine
from humanoid_getup.jobs.requests.bench import BenchScenes
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.progress.callback import ProgressMonitor


def make_scene_rises(request: BenchScenes, names: Names, threads: int = 0) -> SceneRises:
    """Prepare the rises in scenes, by methods under the names that they were given."""
    with refusing():
        robot = load_robot(request)
        database = load_database(robot)
    methods = [
        replace(RiseMethod.of(way, database, threads=threads), name=name)
        for name, way in zip(names, request.ways, strict=True)
    ]
    return SceneRises(robot, methods, make_torque_limit(request, robot))


def spread_scenes(request: BenchScenes, rises: SceneRises, monitor: ProgressMonitor) -> RunScenes:
    """Do the rises in scenes on the engine of a request."""
    sources = {scene: make_absolute(scene) for scene in request.scenes}
    away = partial(rise_in_scene, request.ways, sources)
    ways = tuple(map(make_absolute, request.ways))
    return run_on_engine(BenchScenes, request, monitor, rises.measure, away, ways=ways, scenes=())


def rise_in_scene(
    names: Names, sources: Mapping[str, str], request: BenchScenes, piece: ScenePiece
) -> list[MeasuredRise]:
    """Rise in a scene by every method, in a worker that has it at its source."""
    source = sources.get(piece.scene, piece.scene)
    found = _get_scene_rises(request, names).measure(replace(piece, scene=source))
    renamed = rename_policies(found, request.ways, names)
    return [replace(rise, case=piece.scene) for rise in renamed]


@lru_cache(maxsize=1)
def _get_scene_rises(request: BenchScenes, names: Names) -> SceneRises:
    """Prepare the rises of a worker, once."""
    return make_scene_rises(request, names, threads=1)
