"""`getup rise`, `run` and `play`: one way to get a robot up, with a strategy each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.cli.backends import BackendChoice, open_backend
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.inputs import find_motion, find_start, load_world
from humanoid_getup.cli.options.rise import Play, Rise, RunPolicy
from humanoid_getup.cli.output import phase
from humanoid_getup.cli.policies import load_policy
from humanoid_getup.cli.results import hand_over
from humanoid_getup.cli.session import open_session
from humanoid_getup.execution.get_up import lay_down, run_session
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.falls import Fall, settle_posture
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import RiseOptions, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.selection import StrategySelector
from humanoid_getup.strategies.stored_motion import StoredMotion
from humanoid_getup.strategies.track_record import (
    PLAN,
    POLICY,
    StrategyId,
    TrackRecord,
    load_track_record,
)
from robots import Robot
from robots.kinematics import read_posture

WHERE_IT_LAY = "where the robot lay"
OWN_START = "the motion's own"


def rise(command: Rise) -> int:
    """Rise by plan, by policy, or by the better of both; return the exit code."""
    world = load_world(command)
    loaded = _load(command, world.robot)
    with phase("opening the backend") as report, open_backend(command, world) as choice:
        # Without the filter, the purpose is to see whether the raw path stands.
        result = _rise_from(
            command,
            world,
            choice,
            _make_strategy(command, world, choice, loaded),
            report,
            max_attempts=command.attempts,
            preflight=command.filtering,
        )
        report("drawing")
        extra = {
            "method": command.method,
            "planning": command.planning,
            "filtering": command.filtering,
        }
        return hand_over(result, world, command, command.origin or WHERE_IT_LAY, extra)


def run_policy(command: RunPolicy) -> int:
    """Rise once by a policy; return the exit code."""
    world = load_world(command)
    policy = load_policy(world.robot, command.policy, command.torque_limit, command.longest)
    with phase("opening the backend") as report, open_backend(command, world) as choice:
        limit = choice.limit_torque(command.torque_limit)
        name = Path(command.policy).stem
        strategy = LearnedRise(world, policy, torque_limit=limit, name=name)
        result = _rise_from(command, world, choice, strategy, report, max_attempts=1)
        report("drawing")
        extra = {"method": POLICY}
        return hand_over(result, world, command, command.origin or WHERE_IT_LAY, extra)


def play(command: Play) -> int:
    """Rise once by one motion; return the exit code."""
    world = load_world(command)
    motion = find_motion(world.robot, command.motion)
    with phase("opening the backend") as report, open_backend(command, world) as choice:
        start = _lie_down(command, world, motion, choice)
        own_start = start if command.origin is None else None
        with open_session(
            command,
            world,
            choice,
            StoredMotion(world, motion, torque_limit=choice.limit_torque(command.torque_limit)),
            report=report,
            about={"motion": motion.name},
            start=own_start and own_start.posture,
            max_attempts=1,
            settle=own_start is None,
            preflight=command.preflight,
        ) as session:
            rng = np.random.default_rng(command.seed)
            result = run_session(session, rng, start_class=start and start.start_class)
        report("drawing")
        extra = {"motion": motion.name, "strategy": motion.strategy}
        origin = WHERE_IT_LAY if command.is_real else command.origin or OWN_START
        return hand_over(result, world, command, origin, extra)


@dataclass(frozen=True)
class _Loaded:
    """What the strategies of the chosen method need."""

    database: MotionDatabase | None
    policy: OnnxPolicy | None
    records: TrackRecord


def _load(command: Rise, robot: Robot) -> _Loaded:
    """Load what the method needs, before any robot is touched."""
    with refusing():
        records = load_track_record(robot) if command.method == "auto" else TrackRecord()
        database = None if command.method == POLICY else load_database(robot)
    learned = command.method == POLICY or records.knows(StrategyId(POLICY, command.policy))
    policy = load_policy(robot, command.policy, command.torque_limit) if learned else None
    return _Loaded(database, policy, records)


def _make_strategy(command: Rise, world: World, choice: BackendChoice, loaded: _Loaded) -> Strategy:
    limit = choice.limit_torque(command.torque_limit)
    strategies: dict[StrategyId, Strategy] = {}
    if loaded.database is not None:
        options = RiseOptions(
            planning=command.planning, filtering=command.filtering, torque_limit=limit
        )
        strategies[StrategyId(PLAN)] = PlannedRise(world, loaded.database, options)
    if loaded.policy is not None:
        strategies[StrategyId(POLICY, command.policy)] = LearnedRise(
            world, loaded.policy, torque_limit=limit, name=command.policy
        )
    return StrategySelector(strategies, loaded.records, limit)


def _rise_from(
    command: Rise | RunPolicy,
    world: World,
    choice: BackendChoice,
    strategy: Strategy,
    report: Callable[[str], None],
    **options: Any,
) -> RiseResult:
    """Lay a simulated robot down as a command requests, or leave it where it is; get it up."""
    rng = np.random.default_rng(command.seed)
    start = None if command.origin is None else find_start(world, command.origin, rng)
    if start is not None and choice.place is not None:
        lay_down(world, start, choice.place)
    with open_session(command, world, choice, strategy, report=report, **options) as session:
        return run_session(session, rng, start_class=start and start.start_class)


def _lie_down(command: Play, world: World, motion: Motion, choice: BackendChoice) -> Fall | None:
    """Place a simulated robot at its start and return that; ``None`` for a real robot."""
    if choice.place is None:
        return None
    if command.origin is None:
        at_rest = settle_posture(world, motion.posture(0))
        posture = read_posture(world.robot, world.model, at_rest)
        start = Fall(posture=posture, start_class=motion.start_class)
    else:
        start = find_start(world, command.origin, np.random.default_rng(command.seed))
    choice.place(start.posture)
    return start
