"""From names to strategies: what a user or a benchmark asks for, made for a world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from humanoid_getup.motions.key_posture import KeyPosture
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.motions.preference import PreferenceName
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import SEARCH_BUDGET, PlannedRise, PlannerOptions
from humanoid_getup.strategies.selection import StrategySelector
from humanoid_getup.strategies.stored_motion import NearestMotion
from humanoid_getup.strategies.styled_rise import PLANNED, StyledRise
from humanoid_getup.strategies.track_record import (
    PLAN,
    POLICY,
    StrategyId,
    TrackRecord,
    load_track_record,
)
from robots import FULL_TORQUE, Posture, TorqueLimit

NEAREST, STRAIGHT = "nearest", "straight"
"""Baselines: the nearest stored motion as it is, and a straight way to it without physics."""
DEFAULT_POLICY, STYLED_POLICY = "robust", "styled"


@dataclass(frozen=True, kw_only=True)
class StrategyRequest:
    """What a robot should get up by."""

    method: Literal["plan", "policy", "auto"] = "plan"
    """Plan a motion, run a policy, or use what has the better track record for the start."""
    torque_limit: TorqueLimit = FULL_TORQUE
    """Of the servos."""
    prefer: PreferenceName = "time"
    """What a planned rise should be besides successful."""
    search_budget: float = SEARCH_BUDGET
    """Simulated time in which a search may vary a rollout's targets [s]."""
    keys: tuple[Posture | KeyPosture, ...] = ()
    """Key postures for a planned rise, in order."""
    options: PlannerOptions | None = None
    """Of the planner; None for the best known."""
    policy: str | None = None
    """Name of a policy, or its file; None for the robust one, or the styled one with a style."""
    style: str | None = None
    """What a policy that follows style curves follows: a style, its file, or ``planned``."""


def choose_strategy(
    world: World,
    request: StrategyRequest,
    cached: Callable[[PlannedRise], Strategy] = lambda planner: planner,
) -> Strategy:
    """Make the strategy of a request for a world; ``cached`` may put a cache before the planner.

    Raises:
        ValueError: if motions, policy, style or track record cannot be loaded or do not fit.
    """
    robot, limit = world.robot, request.torque_limit
    records = load_track_record(robot) if request.method == "auto" else TrackRecord()
    strategies: dict[StrategyId, Strategy] = {}
    if request.method != POLICY:
        planner = PlannedRise(
            world,
            torque_limit=limit,
            prefer=request.prefer,
            search_budget=request.search_budget,
            keys=request.keys,
            options=request.options,
        )
        strategies[StrategyId(PLAN)] = cached(planner)
    name = request.policy or (STYLED_POLICY if request.style else DEFAULT_POLICY)
    learned = StrategyId(POLICY, name)
    is_known = records.knows(learned) and robot.body.is_original
    if request.method == POLICY or is_known:
        rise = LearnedRise(world, name, torque_limit=limit, name=name)
        strategies[learned] = apply_style(rise, request.style)
    return StrategySelector(strategies, records)


def make_strategy(
    world: World,
    name: str,
    *,
    torque_limit: TorqueLimit = FULL_TORQUE,
    database: MotionDatabase | None = None,
) -> Strategy:
    """Make the strategy of a name, as benchmarks compare them.

    Args:
        world: Robot and scene.
        name: `PLAN`, `STRAIGHT`, `NEAREST`, or a policy by its name or file.
        torque_limit: Of the servos.
        database: Motions to plan with; ``None`` for the robot's own.

    Raises:
        ValueError: if there is no such policy, or it does not fit.
    """
    if name == PLAN:
        return PlannedRise(world, database, torque_limit=torque_limit)
    if name == STRAIGHT:
        plain = PlannerOptions(planning=False, filtering=False)
        return PlannedRise(world, database, torque_limit=torque_limit, options=plain)
    if name == NEAREST:
        return NearestMotion(world, database, torque_limit=torque_limit)
    return LearnedRise(world, name, torque_limit=torque_limit, name=name)


def apply_style(learned: LearnedRise, style: str | None) -> Strategy:
    """Let a policy follow a style by its name or file, or the curves of a plan (``planned``).

    Raises:
        ValueError: if there is no such style, or the policy follows none.
    """
    if style is None:
        return learned
    limit = learned.torque_limit
    if style == PLANNED:
        return StyledRise(learned, PlannedRise(learned.world, torque_limit=limit))
    return LearnedRise(
        learned.world, learned.policy, torque_limit=limit, name=learned.name, style=style
    )
