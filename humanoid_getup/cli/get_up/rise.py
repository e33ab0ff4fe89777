"""`getup rise`, `run` and `play`: rises by different strategies."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from humanoid_getup.cli.get_up.results import naming_hand_over, write_results
from humanoid_getup.cli.get_up.session import run_session
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import Session
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import (
    find_motion,
    load_keys,
    load_world,
    make_torque_limit,
)
from humanoid_getup.jobs.plan_cache import open_plan_cache, refuse_damage
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.rise import GetUpOptions, PlayRequest, RiseRequest, RunRequest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.reporting.report import RiseSettings
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.cached_rise import CachedRise
from humanoid_getup.strategies.choice import StrategyRequest, apply_style, choose_strategy
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from humanoid_getup.strategies.stored_motion import StoredMotion
from humanoid_getup.strategies.track_record import POLICY


def rise(command: RiseRequest) -> int:
    """Rise by plan, by policy, or by the better of both; return the exit code."""
    return _get_up(
        command,
        _select_strategy(command, load_world(command)),
        max_attempts=command.attempts,
        # Without the filter, the purpose is to see whether the raw path stands.
        preflight=command.filtering,
        settings=RiseSettings(
            method=command.method, planning=command.planning, filtering=command.filtering
        ),
    )


def run_policy(command: RunRequest) -> int:
    """Rise once by a policy; return the exit code."""
    command = name_robot(command, command.policy)
    world = load_world(command)
    policy = load_policy(world.robot, command.policy, command.torque_limit, command.longest)
    name = Path(command.policy).stem
    limit = make_torque_limit(command, world.robot)
    learned = LearnedRise(world, policy, torque_limit=limit, name=name)
    with refusing():
        strategy = apply_style(learned, command.style)
    return _get_up(command, strategy, settings=RiseSettings(method=POLICY))


def play(command: PlayRequest) -> int:
    """Rise once by one motion; return the exit code."""
    world = load_world(command)
    motion = find_motion(world.robot, command.motion)
    with refusing():
        strategy = StoredMotion(world, motion, torque_limit=make_torque_limit(command, world.robot))
    if command.without_imu and world.robot.imu_kind is not None:
        raise BadInputError(
            f"--without-imu is given, but robot '{world.robot.name}' has an IMU "
            f"({world.robot.imu_kind}): expected a robot whose robot.toml has neither [imu] nor "
            "[bus.board]"
        )
    return _get_up(
        command,
        strategy,
        motion,
        preflight=command.preflight,
        without_imu=command.without_imu,
        settings=RiseSettings(),
    )


def _select_strategy(command: RiseRequest, world: World) -> Strategy:
    """Load the strategy of the method, before any robot is touched."""
    request = StrategyRequest(
        method=command.method,
        torque_limit=make_torque_limit(command, world.robot),
        prefer=command.prefer,
        search_budget=command.search_budget,
        keys=tuple(load_keys(world, command.key)),
        options=PlannerOptions(planning=command.planning, filtering=command.filtering),
        policy=command.policy,
        style=command.style,
    )
    with refusing():
        return choose_strategy(world, request, partial(_use_cache, command))


def _use_cache(command: RiseRequest, planner: PlannedRise) -> Strategy:
    """Add the plan cache of a command to a planner; rises through key postures have none.

    A planner without a motion from the side on which the robot is to lie is warned of.

    Raises:
        BadInputError: if the command names a folder that holds damaged entries. Those of the
            user's own folder are ignored, with a line on standard error.
    """
    has_imu = planner.world.robot.imu_kind is not None  # without one, no rise begins
    if has_imu and (gap := planner.describe_gap(command.origin)):
        _warn(gap)
    if not (command.plan_cache and command.filtering) or command.key:
        return planner
    cache = open_plan_cache(command.cache_folder)
    if command.cache_folder is not None:
        with refusing():
            refuse_damage(cache, planner.world.robot.name, command.cache_folder)
    return CachedRise(planner, cache, report=_warn)


def _warn(problem: str) -> None:
    print(f"getup: {problem}", file=sys.stderr)


def _get_up(
    command: GetUpOptions,
    strategy: Strategy,
    motion: Motion | None = None,
    *,
    max_attempts: int = 1,
    preflight: bool = True,
    without_imu: bool = False,
    settings: RiseSettings,
) -> int:
    """Get the robot of a command up and write the result; return the exit code."""

    def prepare(session: Session, rng: np.random.Generator) -> Callable[[], RiseResult]:
        manager = AttemptManager(session, strategy, max_attempts=max_attempts)
        return lambda: manager.get_up(rng)

    def finish(result: RiseResult, start: str) -> int:
        with naming_hand_over(result.after):
            return write_results(result, strategy.world, command, start, settings, motion)

    return run_session(
        command,
        strategy,
        prepare,
        finish,
        motion=motion,
        without_imu=without_imu,
        preflight=preflight,
    )
