"""The main job: get a fallen robot up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drivers import Backend, Cycle, SafetyGuard, Twin
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.result import PhaseChange, RiseResult
from humanoid_getup.execution.rise_session import AttemptOptions, RiseSession
from humanoid_getup.playback.estimation import check_start
from humanoid_getup.simulation.falls import Fall
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import WorldStrategy
from robots import Posture


def get_up(
    backend: Backend,
    strategy: WorldStrategy,
    *,
    seed: int | np.random.Generator = 0,
    max_attempts: int = 3,
    realtime: bool | None = None,
    on_phase: Callable[[PhaseChange], None] = lambda _: None,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> RiseResult:
    """Get a robot up from where it lies, on any backend.

    Every command passes a safety guard, and the torque limit is the strategy's. A twin is judged
    by ground truth, every other robot by its sensors alone. Torque is off afterwards, unless the
    backend was built to hold the last position.

    Args:
        backend: Twin, robot, or a `SafetyGuard` around either. Without a guard it is put behind
            one with the robot's limits and the strategy's torque limit.
        strategy: Finds a way to get up.
        seed: Of the plans.
        max_attempts: After so many failures it asks for help.
        realtime: Pace the cycles by the wall clock; ``None`` for all but a twin.
        on_phase: Called with every phase: settling, planning, preflight, playing...
        on_cycle: Called with every control cycle of the runs.

    Raises:
        ValueError: if the strategy is for another robot.
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    world, robot = strategy.world, backend.robot
    if world.robot.joint_names != robot.joint_names:
        raise ValueError(
            f"the strategy is for robot '{world.robot.name}', expected '{robot.name}' with the "
            "same joints, as the backend has"
        )
    if realtime is None:
        body = backend.backend if isinstance(backend, SafetyGuard) else backend
        realtime = not isinstance(body, Twin)
    session = RiseSession.on(
        backend,
        world,
        strategy,
        AttemptOptions(
            max_attempts=max_attempts, torque_limit=strategy.torque_limit, realtime=realtime
        ),
        on_phase=on_phase,
        on_cycle=on_cycle,
    )
    return run_session(session, np.random.default_rng(seed))


def run_session(
    session: RiseSession, rng: np.random.Generator, *, start_class: str | None = None
) -> RiseResult:
    """Get the robot of a session up from where it lies.

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
