"""Motions of a robot that are played, as pieces."""

from __future__ import annotations

from functools import lru_cache, partial

from humanoid_getup.benchmarks.motions import (
    MotionPiece,
    MotionSummary,
    RunMotions,
    measure_motion,
)
from humanoid_getup.jobs.inputs import load_world
from humanoid_getup.jobs.pieces.spreading import run_on_engine
from humanoid_getup.jobs.requests.bench import BenchMotions
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World


def spread_motions(request: BenchMotions, world: World, monitor: ProgressMonitor) -> RunMotions:
    """Play motions on the engine of a request."""
    return run_on_engine(
        BenchMotions, request, monitor, partial(measure_motion, world), play_motion
    )


def play_motion(request: BenchMotions, piece: MotionPiece) -> MotionSummary:
    """Play a motion undisturbed and disturbed, in a worker."""
    return measure_motion(_get_world(request), piece, threads=1)


_get_world = lru_cache(maxsize=1)(load_world)
