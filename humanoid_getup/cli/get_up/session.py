"""The session of a command that moves a robot: its backend, start, flight log and stop key."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from humanoid_getup.cli.backends import open_backend
from humanoid_getup.cli.get_up.recording import make_log, recording
from humanoid_getup.cli.get_up.session_hooks import Result, SessionHooks
from humanoid_getup.cli.shared.console import phase
from humanoid_getup.execution.dead_reckoning import DeadReckoning
from humanoid_getup.execution.session import Session, SessionOptions
from humanoid_getup.experiments.starts.falls import Fall, find_rest
from humanoid_getup.jobs.inputs import find_start
from humanoid_getup.jobs.requests.rise import GetUpOptions
from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy

WHERE_IT_LAY = "where the robot lay"
OWN_START = "the motion's own"


def run_session(
    command: GetUpOptions,
    strategy: Strategy,
    prepare: Callable[[Session, np.random.Generator], Callable[[], Result]],
    finish: Callable[[Result, str], int],
    *,
    motion: Motion | None = None,
    without_imu: bool = False,
    **options: Any,
) -> int:
    """Open the session of a command, do its work in it, and return the exit code.

    A simulated robot is placed at the start of the command, or else at that of the motion.

    Args:
        command: Options of the command.
        strategy: Strategy of the rise.
        prepare: Checks the request, which may raise `ValueError`, and returns the work.
        finish: Writes the result, with the start of the robot; returns the exit code.
        motion: The motion that is played, if it is known beforehand.
        without_imu: Whether the robot has no IMU; it is taken to lie where the motion begins.
        options: Further options of the session.
    """
    world, rng = strategy.world, np.random.default_rng(command.seed)
    opened = open_backend(command, world, strategy.torque_limit, without_imu=without_imu)
    with phase("opening the backend") as report, opened as choice:
        start = _choose_start(command, world, motion, rng)
        if start is not None and choice.place is not None:
            choice.place(start.posture)
        own_start = start if command.origin is None else None
        about = {} if motion is None else {"motion": motion.name}
        log = make_log(command, world.robot, own_start and own_start.posture, **about)
        with recording(log) as recorder:
            hooks = SessionHooks(choice, recorder, report)
            if without_imu and motion is not None:
                options["assumed_start"] = find_rest(world, motion.posture(0))
            chosen = SessionOptions(
                start_class=start and start.start_class,
                settle=own_start is None,
                balance=command.balance,
                then=command.ending,
                **options,
            )
            chosen = _locate(command, hooks.join(chosen))
            session = Session.on(choice.backend, world, strategy.torque_limit, chosen)
            result = hooks.work(session.guard, lambda: prepare(session, rng))
        report("drawing")
        origin = command.origin or (OWN_START if own_start else WHERE_IT_LAY)
        return finish(result, origin)


def _locate(command: GetUpOptions, options: SessionOptions) -> SessionOptions:
    """Add the locator of a session for a real robot; a simulated one needs none."""
    if command.at is None:
        return options
    x, y, heading = command.at
    reckoning = DeadReckoning(Placement(x=x, y=y, heading=math.radians(heading)))
    return replace(options, locate=reckoning.locate, moved=reckoning.move)


def _choose_start(
    command: GetUpOptions, world: World, motion: Motion | None, rng: np.random.Generator
) -> Fall | None:
    """Find where a simulated robot starts; ``None`` for a real one, which starts as it lies."""
    if command.origin is not None:
        return find_start(world, command.origin, rng)
    if command.is_real or motion is None:
        return None
    return Fall(posture=find_rest(world, motion.posture(0)), start_class=motion.start_class)
