"""Ways down from disturbed stands, as pieces."""

from __future__ import annotations

from functools import lru_cache, partial

from humanoid_getup.benchmarks.sit import RunSits, SitPiece, WayDown, sit_down
from humanoid_getup.jobs.inputs import load_world
from humanoid_getup.jobs.pieces.spreading import run_on_engine
from humanoid_getup.jobs.requests.bench import BenchSit
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World


def spread_sits(request: BenchSit, world: World, monitor: ProgressMonitor) -> RunSits:
    """Sit and lie down on the engine of a request."""
    return run_on_engine(BenchSit, request, monitor, partial(sit_down, world), sit_from)


def sit_from(request: BenchSit, piece: SitPiece) -> WayDown:
    """Sit and lie down from a disturbed stand, in a worker."""
    return sit_down(_get_world(request), piece)


_get_world = lru_cache(maxsize=1)(load_world)
