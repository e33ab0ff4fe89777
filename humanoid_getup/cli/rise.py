"""`getup rise`, `run` and `play`: one way to get a robot up, with a strategy each."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.cli.backends import open_backend
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.inputs import (
    find_motion,
    find_start,
    load_keys,
    load_world,
    make_torque_limit,
)
from humanoid_getup.cli.operator_key import OperatorKey
from humanoid_getup.cli.options.rise import Play, Rise, RunPolicy
from humanoid_getup.cli.options.shared import RunOptions
from humanoid_getup.cli.output import phase
from humanoid_getup.cli.plan_cache import use_cache
from humanoid_getup.cli.policies import load_policy, name_robot
from humanoid_getup.cli.recording import make_log, recording
from humanoid_getup.cli.results import hand_over, reporting_hand_over
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.dead_reckoning import DeadReckoning
from humanoid_getup.execution.phase import PhaseChange
from humanoid_getup.execution.rise_session import RiseSession
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import Fall, settle_posture
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.selection import StrategySelector
from humanoid_getup.strategies.stored_motion import StoredMotion
from humanoid_getup.strategies.styled_rise import PLANNED, StyledRise
from humanoid_getup.strategies.track_record import (
    PLAN,
    POLICY,
    StrategyId,
    TrackRecord,
    load_track_record,
)
from robots.kinematics import read_posture

WHERE_IT_LAY = "where the robot lay"
OWN_START = "the motion's own"
DEFAULT_POLICY = "robust"
STYLED_POLICY = "styled"


def rise(command: Rise) -> int:
    """Rise by plan, by policy, or by the better of both; return the exit code."""
    return _get_up(
        command,
        _select_strategy(command, load_world(command)),
        max_attempts=command.attempts,
        # Without the filter, the purpose is to see whether the raw path stands.
        preflight=command.filtering,
        extra={
            "method": command.method,
            "planning": command.planning,
            "filtering": command.filtering,
        },
    )


def run_policy(command: RunPolicy) -> int:
    """Rise once by a policy; return the exit code."""
    command = name_robot(command, command.policy)
    world = load_world(command)
    policy = load_policy(world.robot, command.policy, command.torque_limit, command.longest)
    name = Path(command.policy).stem
    limit = make_torque_limit(command, world.robot)
    learned = LearnedRise(world, policy, torque_limit=limit, name=name)
    strategy = _apply_style(learned, command.style)
    return _get_up(command, strategy, extra={"method": POLICY})


def play(command: Play) -> int:
    """Rise once by one motion; return the exit code."""
    world = load_world(command)
    motion = find_motion(world.robot, command.motion)
    with refusing():
        strategy = StoredMotion(world, motion, torque_limit=make_torque_limit(command, world.robot))
    return _get_up(
        command,
        strategy,
        motion,
        preflight=command.preflight,
        extra={"motion": motion.name, "strategy": motion.strategy},
    )


def _select_strategy(command: Rise, world: World) -> Strategy:
    """Load what the method needs, before any robot is touched."""
    robot, limit = world.robot, make_torque_limit(command, world.robot)
    with refusing():
        records = load_track_record(robot) if command.method == "auto" else TrackRecord()
        database = None if command.method == POLICY else load_database(robot)
    strategies: dict[StrategyId, Strategy] = {}
    if database is not None:
        planner = PlannedRise(
            world,
            database,
            planning=command.planning,
            filtering=command.filtering,
            torque_limit=limit,
            prefer=command.prefer,
            search_budget=command.search_budget,
            keys=load_keys(world, command.key),
        )
        strategies[StrategyId(PLAN)] = use_cache(command, planner)
    name = command.policy or (STYLED_POLICY if command.style else DEFAULT_POLICY)
    learned = StrategyId(POLICY, name)
    is_known = records.knows(learned) and robot.body.is_original
    if command.method == POLICY or is_known:
        policy = load_policy(robot, name, command.torque_limit)
        rise = LearnedRise(world, policy, torque_limit=limit, name=name)
        strategies[learned] = _apply_style(rise, command.style)
    return StrategySelector(strategies, records)


def _apply_style(learned: LearnedRise, style: str | None) -> Strategy:
    """Let a policy follow the style of a command, if it has one."""
    if style is None:
        return learned
    with refusing():
        if style == PLANNED:
            limit = learned.torque_limit
            return StyledRise(learned, PlannedRise(learned.world, torque_limit=limit))
        return LearnedRise(
            learned.world,
            learned.policy,
            torque_limit=learned.torque_limit,
            name=learned.name,
            style=style,
        )


def _get_up(
    command: RunOptions,
    strategy: Strategy,
    motion: Motion | None = None,
    *,
    max_attempts: int = 1,
    preflight: bool = True,
    extra: dict[str, Any],
) -> int:
    """Get the robot of a command up and hand the result over; return the exit code.

    A simulated robot is placed at the start of the command, or else at that of the motion. The
    extra keys are those of the report.
    """
    world, rng = strategy.world, np.random.default_rng(command.seed)
    opened = open_backend(command, world, strategy.torque_limit)
    with phase("opening the backend") as report, opened as choice:
        start = _choose_start(command, world, motion, rng)
        if start is not None and choice.place is not None:
            choice.place(start.posture)
        own_start = start if command.origin is None else None
        about = {} if motion is None else {"motion": motion.name}
        log = make_log(command, world.robot, own_start and own_start.posture, **about)
        with recording(log) as recorder:
            key = OperatorKey(realtime=choice.realtime)

            def note(change: PhaseChange) -> None:
                key.note(change)
                report(change.phase.value)
                recorder.note(change)

            session = RiseSession.on(
                choice.backend,
                strategy,
                max_attempts=max_attempts,
                start_class=start and start.start_class,
                settle=own_start is None,
                preflight=preflight,
                balance=command.balance,
                then=command.ending,
                is_released=key.is_released,
                realtime=choice.realtime,
                simulation=choice.simulation,
                **_locate(command),
                on_phase=note,
                on_cycle=recorder.log,
            )
            with refusing():
                manager = AttemptManager(session)
            with key.watch(session.guard):
                result = manager.get_up(rng)
        report("drawing")
        origin = command.origin or (OWN_START if own_start else WHERE_IT_LAY)
        with reporting_hand_over(result.after):
            return hand_over(result, world, command, origin, extra)


def _locate(command: RunOptions) -> dict[str, Any]:
    """Return what tells a session where a real robot lies; a simulated one knows."""
    if command.at is None:
        return {}
    x, y, heading = command.at
    reckoning = DeadReckoning(Placement(x=x, y=y, heading=math.radians(heading)))
    return {"locate": reckoning.locate, "moved": reckoning.move}


def _choose_start(
    command: RunOptions, world: World, motion: Motion | None, rng: np.random.Generator
) -> Fall | None:
    """Find where a simulated robot starts; ``None`` for a real one, which starts as it lies."""
    if command.origin is not None:
        return find_start(world, command.origin, rng)
    if command.is_real or motion is None:
        return None
    at_rest = settle_posture(world, motion.posture(0))
    posture = read_posture(world.robot, world.model, at_rest)
    return Fall(posture=posture, start_class=motion.start_class)
