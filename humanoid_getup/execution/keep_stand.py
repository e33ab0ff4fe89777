"""What a robot that stands does next: hold, sit and lie down, go limp, or be handed over."""

from __future__ import annotations

from collections.abc import Callable

from drivers import Backend, Cycle, SafetyGuard, Twin
from humanoid_getup.execution.after_stand import AfterStand
from humanoid_getup.execution.phase import PhaseChange
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.execution.stand_session import StandSession, Then
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit


def keep_stand(
    backend: Backend,
    world: World,
    *,
    then: Then = "sit",
    torque_limit: TorqueLimit = FULL_TORQUE,
    is_released: Callable[[], bool] = lambda: True,
    realtime: bool | None = None,
    on_phase: Callable[[PhaseChange], None] = lambda _: None,
    on_cycle: Callable[[Cycle], None] | None = None,
) -> AfterStand:
    """Take over a robot that stands, on any backend; its torque comes on where its joints are.

    Args:
        backend: Twin, robot, or a `SafetyGuard` around either.
        world: The robot in its scene.
        then: ``"sit"`` and lie down at once; or hold a judged stand at least, until it is released,
            and then sit and lie down (``"hold"``), go ``"limp"``, or stay under torque for another
            program (``"hand-over"``).
        torque_limit: Of the servos.
        is_released: Whether a robot that is held may go on; called every cycle.
        realtime: Pace the cycles by the wall clock; ``None`` for all but a twin.
        on_phase: Called with every phase.
        on_cycle: Called with every control cycle.

    Raises:
        ValueError: if the robot has no motion to lie down with and should.
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    body = backend.backend if isinstance(backend, SafetyGuard) else backend
    session = StandSession.on(
        backend,
        world,
        torque_limit,
        then=then,
        is_released=is_released,
        realtime=not isinstance(body, Twin) if realtime is None else realtime,
        on_phase=on_phase,
        on_cycle=on_cycle,
    )
    return StandKeeper(session).start()
