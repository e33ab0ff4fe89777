"""The main job: get a fallen robot up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.rise_session import RiseSession
from humanoid_getup.playback.estimation import check_start
from humanoid_getup.simulation.falls import Fall
from humanoid_getup.simulation.world import World
from robots import Posture


def get_up(
    session: RiseSession, rng: np.random.Generator, *, start_class: str | None = None
) -> RiseResult:
    """Get a robot up from where it lies, on any backend.

    Args:
        session: Robot, strategy, options and hooks.
        rng: Randomness of the plans.
        start_class: Side on which it lies, where that is known; else as first measured.

    Raises:
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    result = AttemptManager(session).get_up(rng)
    return result if start_class is None else replace(result, start_class=start_class)


def lay_down(world: World, fall: Fall, place: Callable[[Posture], None]) -> None:
    """Put a simulated robot where it fell.

    Raises:
        StartError: if the posture reaches into the ground or hangs above it.
    """
    check_start(world, fall.posture)
    place(fall.posture)
