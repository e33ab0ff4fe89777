"""The session of a job that gets a robot up: its backend, start, flight log and operator."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from humanoid_getup.execution.dead_reckoning import DeadReckoning
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import Session, SessionOptions
from humanoid_getup.experiments.starts.falls import Fall, find_rest
from humanoid_getup.jobs.backends import open_backend
from humanoid_getup.jobs.get_up.operator import Operator
from humanoid_getup.jobs.get_up.recording import make_log, recording
from humanoid_getup.jobs.get_up.session_hooks import SessionHooks
from humanoid_getup.jobs.inputs import find_start
from humanoid_getup.jobs.requests.rise import GetUpOptions
from humanoid_getup.motions.motion import Motion
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy


@dataclass(frozen=True, kw_only=True)
class PlayedSession:
    """What a session ended with."""

    rise: RiseResult
    start: Fall | None
    """Where a simulated robot was placed; None for a real one, which starts as it lies."""


def run_session(
    request: GetUpOptions,
    strategy: Strategy,
    prepare: Callable[[Session, np.random.Generator], Callable[[], RiseResult]],
    monitor: ProgressMonitor,
    operator: Operator,
    *,
    motion: Motion | None = None,
    without_imu: bool = False,
    **options: Any,
) -> PlayedSession:
    """Open the session of a request, and do its work in it.

    A simulated robot is placed at the start of the request, or else at that of the motion.

    Args:
        request: Options of the rise.
        strategy: Strategy of the rise.
        prepare: Checks the request, which may raise `ValueError`, and returns the work.
        monitor: Shows the phases, and ends the work if it is canceled.
        operator: Watches while the robot moves.
        motion: The motion that is played, if it is known beforehand.
        without_imu: Whether the robot has no IMU; it is taken to lie where the motion begins.
        options: Further options of the session.
    """
    world, rng = strategy.world, np.random.default_rng(request.seed)
    monitor.begin("opening the backend")
    with open_backend(request, world, strategy.torque_limit, without_imu=without_imu) as choice:
        start = _choose_start(request, world, motion, rng)
        if start is not None and choice.place is not None:
            choice.place(start.posture)
        own_start = start if request.origin is None else None
        about = {} if motion is None else {"motion": motion.name}
        log = make_log(request, world.robot, own_start and own_start.posture, **about)
        with recording(log, monitor.tell) as recorder:
            hooks = SessionHooks(choice, recorder, monitor, operator)
            if without_imu and motion is not None:
                options["assumed_start"] = find_rest(world, motion.posture(0))
            chosen = SessionOptions(
                start_class=start and start.start_class,
                settle=own_start is None,
                balance=request.balance,
                then=request.ending,
                **options,
            )
            chosen = _locate(request, hooks.join(chosen))
            guard, limit = hooks.guard(strategy.torque_limit), strategy.torque_limit
            session = Session.on(guard, world, limit, chosen)
            rise = hooks.work(guard, lambda: prepare(session, rng))
    return PlayedSession(rise=rise, start=start)


def _locate(request: GetUpOptions, options: SessionOptions) -> SessionOptions:
    """Add the locator of a session for a real robot; a simulated one needs none."""
    if request.at is None:
        return options
    x, y, heading = request.at
    reckoning = DeadReckoning(Placement(x=x, y=y, heading=math.radians(heading)))
    return replace(options, locate=reckoning.locate, moved=reckoning.move)


def _choose_start(
    request: GetUpOptions, world: World, motion: Motion | None, rng: np.random.Generator
) -> Fall | None:
    """Find where a simulated robot starts; ``None`` for a real one, which starts as it lies."""
    if request.origin is not None:
        return find_start(world, request.origin, rng)
    if request.is_real or motion is None:
        return None
    return Fall(posture=find_rest(world, motion.posture(0)), start_class=motion.start_class)
