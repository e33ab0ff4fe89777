"""The session of a rise: a backend, a start, a flight log, hooks, attempts, results."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from humanoid_getup.commands.backends import open_backend
from humanoid_getup.commands.get_up.options import GetUpOptions
from humanoid_getup.commands.get_up.recording import make_log, recording
from humanoid_getup.commands.get_up.results import FinishedRise, finish_rise
from humanoid_getup.commands.get_up.session_hooks import NoOperator, Operator, SessionHooks
from humanoid_getup.commands.inputs import find_start
from humanoid_getup.execution.after_stand import naming_hand_over
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import DeadReckoning, SessionOptions
from humanoid_getup.experiments.falls import Fall, find_rest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy


def run_session(
    request: GetUpOptions,
    strategy: Strategy,
    monitor: ProgressMonitor,
    operator: Operator | None,
    *,
    motion: Motion | None = None,
    without_imu: bool = False,
    **options: Any,
) -> FinishedRise:
    """Get the robot of a request up by a strategy, and write the result.

    A simulated robot is placed at the start of the request, or else at that of the motion.

    Args:
        request: Options of the rise.
        strategy: Strategy of the rise.
        monitor: Shows the phases, and ends the work if it is canceled.
        operator: Watches while the robot moves; None for no operator.
        motion: The motion that is played, if it is known beforehand.
        without_imu: Whether the robot has no IMU; it is taken to lie where the motion begins.
        options: Further options of the session.
    """
    world, limit = strategy.world, strategy.torque_limit
    rng = np.random.default_rng(request.seed)
    monitor.begin("opening the backend")
    rise: Rise | None = None
    with (
        naming_hand_over(lambda: rise and rise.hand_over),
        open_backend(request, world, limit, without_imu=without_imu) as choice,
    ):
        start = _choose_start(request, world, motion, rng, monitor.tell)
        if start is not None and choice.place is not None:
            choice.place(start.posture)
        # At the start of its motion a simulated robot rests already, and need not settle.
        motion_start = start if request.origin is None else None
        about = {} if motion is None else {"motion": motion.name}
        log = make_log(request, world.robot, motion_start and motion_start.posture, **about)
        with recording(log, monitor.tell) as recorder:
            hooks = SessionHooks(request, choice, recorder, monitor, operator or NoOperator())
            chosen = SessionOptions(
                start_class=start and start.start_class,
                settle=motion_start is None,
                balance=request.balance,
                then=request.ending,
                **options,
            )
            if without_imu and motion is not None:
                chosen = replace(chosen, assumed_start=find_rest(world, motion.posture(0)))
            session = hooks.begin(world, limit, _locate(request, chosen))
            manager = AttemptManager(session, strategy, max_attempts=request.most_attempts)
            rise = hooks.work(session, lambda: manager.get_up(rng))
    monitor.begin("drawing")
    return finish_rise(rise, start, world, request, motion, choice.findings)


def _locate(request: GetUpOptions, options: SessionOptions) -> SessionOptions:
    """Add the locator of a session for a real robot; a simulated one needs none."""
    if request.at is None:
        return options
    x, y, heading = request.at
    reckoning = DeadReckoning(Placement(x=x, y=y, heading=math.radians(heading)))
    return replace(options, locate=reckoning.locate, moved=reckoning.move)


def _choose_start(
    request: GetUpOptions,
    world: World,
    motion: Motion | None,
    rng: np.random.Generator,
    tell: Callable[[str], None],
) -> Fall | None:
    """Find where a simulated robot is placed; ``None`` if the robot starts as it lies."""
    if request.origin is not None:
        return find_start(world, request.origin, rng, tell)
    if request.is_real or motion is None:
        return None
    return Fall(posture=find_rest(world, motion.posture(0)), start_class=motion.start_class)
