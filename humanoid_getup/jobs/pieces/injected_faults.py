"""Plays of a motion with faults on the virtual bus, as pieces."""

from __future__ import annotations

from functools import lru_cache, partial

from humanoid_getup.benchmarks.fault_injection import (
    FaultPiece,
    FaultTrial,
    RunFaults,
    play_with_fault,
)
from humanoid_getup.jobs.inputs import find_motion, load_world
from humanoid_getup.jobs.pieces.spreading import make_absolute, run_on_engine
from humanoid_getup.jobs.requests.bench import BenchFaults
from humanoid_getup.motions.motion import STANDING, Motion
from humanoid_getup.playback.stand_holder import make_stand
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World


def load_played(request: BenchFaults) -> tuple[World, Motion]:
    """Load the world of a benchmark, and the motion that is played, or a stand."""
    world = load_world(request)
    robot, is_stand = world.robot, request.motion == STANDING
    return world, make_stand(robot) if is_stand else find_motion(robot, request.motion)


def spread_faults(
    request: BenchFaults, world: World, motion: Motion, monitor: ProgressMonitor
) -> RunFaults:
    """Play with faults on the engine of a request."""
    here, chosen = partial(play_with_fault, world, motion), make_absolute(request.motion)
    return run_on_engine(BenchFaults, request, monitor, here, inject_fault, motion=chosen)


def inject_fault(request: BenchFaults, piece: FaultPiece) -> FaultTrial:
    """Play with a fault, in a worker."""
    return play_with_fault(*_get_played(request), piece)


_get_played = lru_cache(maxsize=1)(load_played)
