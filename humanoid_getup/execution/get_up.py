"""The main jobs: get a fallen robot up, and keep a stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers import Backend
from humanoid_getup.execution.after_stand import AfterStand
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import Session, SessionOptions, Then
from humanoid_getup.execution.stand_keeper import StandKeeper
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from robots import FULL_TORQUE, TorqueLimit
from robots.arguments import expect, expect_seed


def get_up(
    backend: Backend,
    strategy: Strategy,
    *,
    seed: int | np.random.Generator = 0,
    max_attempts: int = 3,
    then: Then | None = None,
    options: SessionOptions | None = None,
) -> Rise:
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
            torque. ``None`` for what the options say: limp on a twin, hold on servos.
        options: Further choices, and functions to be called with phases and cycles.

    Raises:
        ValueError: if an argument is of another type, if the strategy is for another robot, or if
            the robot has no motion to lie down with, as ``"hold"`` and ``"sit"`` need it.
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    expect("backend", backend, Backend, "a backend, e.g. Twin(world, fall.posture)")
    expect("strategy", strategy, Strategy, "a strategy, e.g. PlannedRise(world)")
    expect("options", options, SessionOptions | None, "e.g. SessionOptions(balance=False)")
    expect("max_attempts", max_attempts, int, "a whole number, 1 or more")
    if not isinstance(seed, np.random.Generator):
        expect_seed(seed)
    world, robot = strategy.world, backend.robot
    if world.robot.joint_names != robot.joint_names:
        raise ValueError(
            f"the strategy is for robot '{world.robot.name}', expected '{robot.name}' with the "
            "same joints, as the backend has"
        )
    options = options or SessionOptions()
    if then is not None:
        options = replace(options, then=then)
    session = Session.on(backend, world, strategy.torque_limit, options)
    manager = AttemptManager(session, strategy, max_attempts=max_attempts)
    result = manager.get_up(np.random.default_rng(seed))
    if result.after is not None and result.after.interrupted:
        raise KeyboardInterrupt
    return result


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
