"""Keeping a stand: hold, sit and lie down, go limp, or hand over."""

from __future__ import annotations

from dataclasses import replace

from drivers import Backend
from humanoid_getup.execution.after_stand import AfterStand
from humanoid_getup.execution.session import Session, SessionOptions, Then
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit
from robots.arguments import expect


def keep_stand(
    backend: Backend,
    world: World,
    *,
    then: Then = "sit",
    torque_limit: TorqueLimit = FULL_TORQUE,
    options: SessionOptions | None = None,
) -> AfterStand:
    """Take over a robot that stands, on any backend; its torque comes on where its joints are.

    Args:
        backend: Twin, robot, or a `SafetyGuard` around either.
        world: The robot in its scene.
        then: ``"sit"`` and lie down at once; or hold a judged stand at least, until it is released,
            and then sit and lie down (``"hold"``), go ``"limp"``, or stay under torque for another
            program (``"hand-over"``).
        torque_limit: Of the servos.
        options: Further choices, and functions to be called with phases and cycles.

    Raises:
        ValueError: if an argument is of another type, or if the robot has no motion to lie down
            with and should.
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    expect("backend", backend, Backend, "a backend, e.g. Twin(world)")
    expect("world", world, World, "a World, e.g. World(robot)")
    expect("options", options, SessionOptions | None, "e.g. SessionOptions(balance=False)")
    options = replace(options or SessionOptions(), then=then)
    result = StandKeeper(Session.on(backend, world, torque_limit, options)).start()
    if result.interrupted:
        raise KeyboardInterrupt
    return result
