"""The main job: get a fallen robot up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from drivers import Backend, Cycle, SafetyGuard, Twin
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.phase import PhaseChange
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.rise_session import RiseSession
from humanoid_getup.execution.stand_session import Then
from humanoid_getup.strategies.plan import Strategy


def get_up(
    backend: Backend,
    strategy: Strategy,
    *,
    seed: int | np.random.Generator = 0,
    max_attempts: int = 3,
    then: Then | None = None,
    is_released: Callable[[], bool] = lambda: True,
    balance: bool = True,
    realtime: bool | None = None,
    on_phase: Callable[[PhaseChange], None] = lambda _: None,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> RiseResult:
    """Get a robot up from where it lies, on any backend.

    Every command passes a safety guard, and the torque limit is the strategy's. A twin is judged
    by ground truth, every other robot by its sensors alone. Torque is off afterwards, unless the
    robot stood and was handed over.

    Args:
        backend: Twin, robot, or a `SafetyGuard` around either. Without a guard it is put behind
            one with the robot's limits and the strategy's torque limit.
        strategy: Finds a way to get up.
        seed: Of the plans.
        max_attempts: Number of failures after which the robot needs help.
        then: What follows a judged stand: ``"hold"`` it until it is released, then sit and lie
            down; ``"sit"`` and lie down at once; go ``"limp"``; or ``"hand-over"`` the robot under
            torque. ``None`` for limp on a twin, and for hold on servos.
        is_released: Whether a robot that is held may sit down; called every cycle.
        balance: Feed the torso's attitude back to the ankles, in a rise by a motion and in its
            stand.
        realtime: Pace the cycles by the wall clock; ``None`` for all but a twin.
        on_phase: Called with every phase: settling, planning, preflight, playing...
        on_cycle: Called with every control cycle of the runs.

    Raises:
        TypeError: if the strategy is not a strategy, but the name of one, for example.
        ValueError: if the strategy is for another robot, or if the robot has no motion to lie
            down with, as ``"hold"`` and ``"sit"`` need it.
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    if not isinstance(strategy, Strategy):
        raise TypeError(f"strategy is {strategy!r}, expected e.g. PlannedRise(world)")
    planned, robot = strategy.world.robot, backend.robot
    if planned.joint_names != robot.joint_names:
        raise ValueError(
            f"the strategy is for robot '{planned.name}', expected '{robot.name}' with the "
            "same joints, as the backend has"
        )
    body = backend.backend if isinstance(backend, SafetyGuard) else backend
    is_twin = isinstance(body, Twin)
    session = RiseSession.on(
        backend,
        strategy,
        max_attempts=max_attempts,
        then=then or ("limp" if is_twin else "hold"),
        is_released=is_released,
        balance=balance,
        realtime=not is_twin if realtime is None else realtime,
        on_phase=on_phase,
        on_cycle=on_cycle,
    )
    return AttemptManager(session).get_up(np.random.default_rng(seed))
