"""What `getup rise`, `run` and `play` have in common: one road, with a strategy each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.options import find_start, load_policy
from humanoid_getup.cli.output import phase
from humanoid_getup.cli.play import Play
from humanoid_getup.cli.results import hand_over
from humanoid_getup.cli.rise import RiseCommand, RunPolicy
from humanoid_getup.cli.session import WHERE_IT_LAY, open_session
from humanoid_getup.execution.get_up import lay_down, run_session
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MotionDatabase, find_motion, load_database
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

OWN_START = "the motion's own"


def rise(command: RiseCommand) -> int:
    """Rise by plan, by policy, or by the better of both; return the exit code."""
    world = command.load_stage()
    loaded = _load(command, world.robot)
    rng = np.random.default_rng(command.seed)
    with phase("opening the backend") as tell, command.open_body(world) as body:
        strategy = _make_strategy(command, world, body, loaded)
        # Without the filter, the purpose is to see whether the raw path stands.
        options = {"max_attempts": command.attempts, "preflight": command.filtering}
        result = _rise_from(command, world, body, strategy, rng, tell, **options)
        tell("drawing")
        extra = {
            "method": command.method,
            "planning": command.planning,
            "filtering": command.filtering,
        }
        return hand_over(result, world, command, command.origin or WHERE_IT_LAY, extra)


def run_policy(command: RunPolicy) -> int:
    """Rise once by a policy; return the exit code."""
    world = command.load_stage()
    policy = load_policy(world.robot, command.policy, command.torque_limit, command.longest)
    rng = np.random.default_rng(command.seed)
    with phase("opening the backend") as tell, command.open_body(world) as body:
        limit = body.limit_torque(command.torque_limit)
        name = Path(command.policy).stem
        strategy = LearnedRise(world, policy, torque_limit=limit, name=name)
        result = _rise_from(command, world, body, strategy, rng, tell, max_attempts=1)
        tell("drawing")
        extra = {"method": POLICY}
        return hand_over(result, world, command, command.origin or WHERE_IT_LAY, extra)


def play(command: Play) -> int:
    """Rise once by one motion; return the exit code."""
    world = command.load_stage()
    with refusing():
        motion = find_motion(world.robot, command.motion)
    with phase("opening the backend") as tell, command.open_body(world) as body:
        start = _lie_down(command, world, motion, body)
        own_start = start if command.origin is None else None
        with open_session(
            command,
            world,
            body,
            StoredMotion(world, motion, torque_limit=body.limit_torque(command.torque_limit)),
            report=tell,
            about={"motion": motion.name},
            start=own_start and own_start.posture,
            max_attempts=1,
            settle=own_start is None,
            preflight=command.preflight,
        ) as session:
            rng = np.random.default_rng(command.seed)
            result = run_session(session, rng, start_class=start and start.start_class)
        tell("drawing")
        extra = {"motion": motion.name, "strategy": motion.strategy}
        origin = WHERE_IT_LAY if command.is_real else command.origin or OWN_START
        return hand_over(result, world, command, origin, extra)


@dataclass(frozen=True)
class _Loaded:
    """What the strategies are made of, as far as the method needs them."""

    database: MotionDatabase | None
    policy: OnnxPolicy | None
    records: TrackRecord


def _load(command: RiseCommand, robot: Robot) -> _Loaded:
    """Load what the method needs, before any robot is touched."""
    with refusing():
        records = load_track_record(robot) if command.method == "auto" else TrackRecord()
        database = None if command.method == POLICY else load_database(robot)
    learned = command.method == POLICY or records.knows(StrategyId(POLICY, command.policy))
    policy = load_policy(robot, command.policy, command.torque_limit) if learned else None
    return _Loaded(database, policy, records)


def _make_strategy(
    command: RiseCommand, world: World, body: BackendChoice, loaded: _Loaded
) -> Strategy:
    limit = body.limit_torque(command.torque_limit)
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
    command: RiseCommand | RunPolicy,
    world: World,
    body: BackendChoice,
    strategy: Strategy,
    rng: np.random.Generator,
    tell: Any,
    **options: Any,
) -> RiseResult:
    """Lay a simulated robot down as a command asks, or leave it where it lies; get it up."""
    start = None if command.origin is None else find_start(world, command.origin, rng)
    if start is not None and body.place is not None:
        lay_down(world, start, body.place)
    with open_session(command, world, body, strategy, report=tell, **options) as session:
        return run_session(session, rng, start_class=start and start.start_class)


def _lie_down(command: Play, world: World, motion: Motion, body: BackendChoice) -> Fall | None:
    """Put a simulated robot where it is to start; ``None`` for a real one."""
    if body.place is None:
        return None
    if command.origin is None:
        at_rest = settle_posture(world, motion.posture(0))
        posture = read_posture(world.robot, world.model, at_rest)
        start = Fall(posture=posture, start_class=motion.start_class)
    else:
        start = find_start(world, command.origin, np.random.default_rng(command.seed))
    body.place(start.posture)
    return start
