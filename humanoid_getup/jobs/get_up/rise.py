"""Jobs that get a robot up: by a plan or a policy, by one motion, or by one policy."""

from __future__ import annotations

from pathlib import Path

from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.get_up.operator import Operator
from humanoid_getup.jobs.get_up.results import FinishedRise
from humanoid_getup.jobs.get_up.session import run_session
from humanoid_getup.jobs.inputs import (
    find_motion,
    load_keys,
    load_world,
    make_torque_limit,
)
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.rise import PlayRequest, RiseRequest, RunRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.report import RiseSettings
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
