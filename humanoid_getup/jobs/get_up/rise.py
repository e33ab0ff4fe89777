"""Jobs that get a robot up: by a plan or a policy, by one motion, or by one policy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.commands.backends import open_backend
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.inputs import (
    find_motion,
    find_start,
    load_keys,
    load_world,
    make_torque_limit,
)
from humanoid_getup.execution.after_stand import naming_hand_over
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.dead_reckoning import DeadReckoning
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.starts.falls import Fall, find_rest
from humanoid_getup.jobs.get_up.recording import make_log, recording
from humanoid_getup.jobs.get_up.results import FinishedRise, finish_rise
from humanoid_getup.jobs.get_up.session_hooks import NoOperator, Operator, SessionHooks
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.rise import GetUpOptions, PlayRequest, RiseRequest, RunRequest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.report import RiseSettings
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import StrategyRequest, apply_style, choose_strategy
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannerOptions
from humanoid_getup.strategies.stored_motion import StoredMotion
from humanoid_getup.strategies.track_record import POLICY


def rise(
    request: RiseRequest,
    report: Report | None = None,
    cancel: Cancel | None = None,
    *,
    operator: Operator | None = None,
) -> FinishedRise:
    """Rise by plan, by policy, or by the better of both.

    ``cancel`` is called at every phase, in every control cycle, and between the steps of a plan,
    the longest of which take a few seconds.
    Without an operator, a robot that is held sits down as soon as its stand is judged.

    Raises:
        BadInputError: if the request cannot be done.
        CancelledError: if ``cancel`` ended it; torque is off, and of the files there is at most
            the flight log.
        KeyboardInterrupt: if it was interrupted; torque is off, unless its text says that the
            robot was handed over.
    """
    RiseRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    return run_session(
        request,
        _select_strategy(request, load_world(request), monitor),
        monitor,
        operator,
        # Without the filter, the purpose is to see whether the raw path stands.
        preflight=request.filtering,
        settings=RiseSettings(
            method=request.method, planning=request.planning, filtering=request.filtering
        ),
    )


def run_policy(
    request: RunRequest,
    report: Report | None = None,
    cancel: Cancel | None = None,
    *,
    operator: Operator | None = None,
) -> FinishedRise:
    """Rise once by a policy, as `rise` does, with the same errors."""
    RunRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    request = name_robot(request, request.policy)
    world = load_world(request)
    policy = load_policy(world.robot, request.policy, request.torque_limit, request.longest)
    name = Path(request.policy).stem
    limit = make_torque_limit(request, world.robot)
    learned = LearnedRise(world, policy, torque_limit=limit, name=name)
    with refusing():
        strategy = apply_style(learned, request.style, monitor)
    return run_session(request, strategy, monitor, operator, settings=RiseSettings(method=POLICY))


def play_motion(
    request: PlayRequest,
    report: Report | None = None,
    cancel: Cancel | None = None,
    *,
    operator: Operator | None = None,
) -> FinishedRise:
    """Rise once by one motion, as `rise` does, with the same errors."""
    PlayRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    world = load_world(request)
    motion = find_motion(world.robot, request.motion)
    with refusing():
        strategy = StoredMotion(world, motion, torque_limit=make_torque_limit(request, world.robot))
    if request.without_imu and world.robot.imu_kind is not None:
        raise BadInputError(
            f"--without-imu is given, but robot '{world.robot.name}' has an IMU "
            f"({world.robot.imu_kind}): expected a robot whose robot.toml has neither [imu] nor "
            "[bus.board]"
        )
    return run_session(
        request,
        strategy,
        monitor,
        operator,
        settings=RiseSettings(),
        motion=motion,
        preflight=request.preflight,
        without_imu=request.without_imu,
    )


def _select_strategy(request: RiseRequest, world: World, monitor: ProgressMonitor) -> Strategy:
    """Load the strategy of the method, before any robot is touched."""
    wanted = StrategyRequest(
        method=request.method,
        torque_limit=make_torque_limit(request, world.robot),
        prefer=request.prefer,
        search_budget=request.search_budget,
        keys=tuple(load_keys(world, request.key)),
        options=PlannerOptions(planning=request.planning, filtering=request.filtering),
        policy=request.policy,
        style=request.style,
        origin=request.origin,
    )
    with refusing():
        return choose_strategy(world, wanted, monitor)


def run_session(
    request: GetUpOptions,
    strategy: Strategy,
    monitor: ProgressMonitor,
    operator: Operator | None,
    *,
    settings: RiseSettings,
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
        settings: Settings for the report.
        motion: The motion that is played, if it is known beforehand.
        without_imu: Whether the robot has no IMU; it is taken to lie where the motion begins.
        options: Further options of the session.
    """
    world, limit = strategy.world, strategy.torque_limit
    rng = np.random.default_rng(request.seed)
    monitor.begin("opening the backend")
    rise: RiseResult | None = None
    with (
        naming_hand_over(lambda: rise and rise.hand_over),
        open_backend(request, world, limit, without_imu=without_imu) as choice,
    ):
        start = _choose_start(request, world, motion, rng, monitor.tell)
        if start is not None and choice.place is not None:
            choice.place(start.posture)
        own_start = start if request.origin is None else None
        about = {} if motion is None else {"motion": motion.name}
        log = make_log(request, world.robot, own_start and own_start.posture, **about)
        with recording(log, monitor.tell) as recorder:
            hooks = SessionHooks(request, choice, recorder, monitor, operator or NoOperator())
            chosen = SessionOptions(
                start_class=start and start.start_class,
                settle=own_start is None,
                balance=request.balance,
                then=request.ending,
                **options,
            )
            if without_imu and motion is not None:
                chosen = replace(chosen, assumed_start=find_rest(world, motion.posture(0)))
            session = hooks.begin(world, limit, _locate(request, chosen))
            with refusing():
                manager = AttemptManager(session, strategy, max_attempts=request.most_attempts)
            rise = hooks.work(session, lambda: manager.get_up(rng))
    monitor.begin("drawing")
    return finish_rise(rise, start, world, request, settings, motion, choice.findings)


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
    """Find where a simulated robot starts; ``None`` for a real one, which starts as it lies."""
    if request.origin is not None:
        return find_start(world, request.origin, rng, tell)
    if request.is_real or motion is None:
        return None
    return Fall(posture=find_rest(world, motion.posture(0)), start_class=motion.start_class)
