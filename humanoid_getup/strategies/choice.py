"""Choice of a strategy by name for a world, or of the best one by track record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from humanoid_getup.experiments.falls import CLASSES, classify
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.motions.motion_database import KeyPosture, MotionDatabase
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import PLANNED, LearnedRise, StyledRise
from humanoid_getup.strategies.plan import Plan, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.stored_motion import NearestMotion
from robots import Posture, Robot, TorqueLimit
from robots.servo import LimitMode
from robots.storage.validation import positive, read_toml, reading, whole

PLAN, POLICY = "plan", "policy"
RECORDS = Path("policies", "records.toml")
LIMIT_SLACK = 1e-9  # N·m
MOST_TORQUE, MOST_RISES = 1000.0, 10**9


@dataclass(frozen=True)
class StrategyId:
    """Identifies a strategy: planning, or one policy."""

    method: str
    """`PLAN` or `POLICY`."""
    policy: str = ""
    """Name of the policy; empty for `PLAN`."""


@dataclass(frozen=True)
class StandCount:
    """Number of rises, and of those that ended in a held stand."""

    stood: Annotated[int, whole(0, MOST_RISES)]
    n: Annotated[int, whole(1, MOST_RISES)]


ClassCount = Annotated[StandCount, Meta(description="{ stood = ..., n = ... }")] | None


@dataclass(frozen=True, kw_only=True)
class StrategyRecord:
    """Success of one strategy under one torque limit: a table [[record]] of the file."""

    method: Literal["plan", "policy"]
    torque_limit: Annotated[float, positive(MOST_TORQUE, "N·m")]
    """Torque limit of every servo [N·m]."""
    policy: str = ""
    limit_by: LimitMode | None = None
    """What the limit acts on; None if that makes no difference."""
    supine: ClassCount = None
    prone: ClassCount = None
    left: ClassCount = None
    right: ClassCount = None

    @property
    def strategy(self) -> StrategyId:
        """Return the strategy that was measured."""
        return StrategyId(self.method, self.policy if self.method == POLICY else "")

    @property
    def counts(self) -> dict[str, StandCount]:
        """Return the counts by start class."""
        return {name: count for name in CLASSES if (count := getattr(self, name)) is not None}


@dataclass(frozen=True)
class TrackRecord:
    """The measured success of a robot's strategies, in its file ``policies/records.toml``.

    Classes that were not measured are left out, and so is ``limit_by`` at full torque::

        [[record]]
        method = "policy"      # or "plan", without a policy
        policy = "robust"
        torque_limit = 2.5     # of every servo [N·m]
        limit_by = "pwm"       # what the limit acts on: "current", "pwm" or "ideal"
        supine = { stood = 240, n = 250 }
    """

    records: tuple[StrategyRecord, ...] = field(default=(), metadata={"key": "record"})

    def knows(self, strategy: StrategyId) -> bool:
        """Return whether a strategy has been measured."""
        return any(record.strategy == strategy for record in self.records)

    def success(self, strategy: StrategyId, start_class: str, torque_limit: TorqueLimit) -> float:
        """Return the expected share of held stands of a strategy, from 0 to 1.

        It is the lower end of the 95 % interval, so that few rises count for little. Stronger
        servos do no harm: the record with the highest torque limit up to the given one counts.
        Without such a record the share is 0.
        """
        limit = math.inf if torque_limit.value is None else torque_limit.value
        fitting = [
            record
            for record in self.records
            if record.strategy == strategy
            and start_class in record.counts
            and record.torque_limit <= limit + LIMIT_SLACK
            and record.limit_by in (None, torque_limit.by)
        ]
        if not fitting:
            return 0.0
        count = max(fitting, key=lambda record: record.torque_limit).counts[start_class]
        return wilson_interval(count.stood, count.n)[0]


def load_track_record(robot: Robot) -> TrackRecord:
    """Load a robot's track record; without a file it is empty."""
    file = robot.folder / RECORDS
    if not file.exists():
        return TrackRecord()
    with reading(str(file)) as problems:
        found = read_toml(TrackRecord, file, problems, is_strict=False)
        for number, record in enumerate(found.records, start=1):
            problems += [f"record number {number}: {problem}" for problem in _find_problems(record)]
        return found


def _find_problems(record: StrategyRecord) -> list[str]:
    problems = []
    if record.method == POLICY and not record.policy:
        problems.append("policy is missing, expected a text")
    return problems + [
        f"{name}.stood is {count.stood}, expected an integer from 0 to {count.n}"
        for name, count in record.counts.items()
        if count.stood > count.n > 0
    ]


NEAREST, STRAIGHT = "nearest", "straight"
"""Baselines: the nearest stored motion, and straight interpolation to it, unfiltered."""
DEFAULT_POLICY, STYLED_POLICY = "robust", "styled"


class StrategySelector:
    """Selects, for each rise, the strategy with the best record for the class of its start.

    Among equals the first is selected, so a default without a record comes first. Starts on no
    side have no record.
    """

    def __init__(self, strategies: dict[StrategyId, Strategy], records: TrackRecord) -> None:
        self._strategies, self._records = strategies, records
        default = next(iter(strategies.values()))
        self.world, self.torque_limit = default.world, default.torque_limit

    def select(self, start_class: str | None) -> StrategyId:
        """Select the strategy for a class of starts, ``None`` for no side."""

        def success(strategy: StrategyId) -> float:
            if start_class is None:
                return 0.0
            return self._records.success(strategy, start_class, self.torque_limit)

        return max(self._strategies, key=success)

    def plan(self, start: Posture, rng: np.random.Generator) -> Plan:
        """Plan a rise by the selected strategy."""
        return self._strategies[self.select(classify(start.orientation))].plan(start, rng)


def choose_strategy(
    world: World,
    method: Literal["plan", "policy", "auto"] = "plan",
    settings: PlannerSettings = DEFAULTS,
    *,
    keys: Sequence[KeyPosture] = (),
    policy: str | None = None,
    style: str | None = None,
    origin: str | None = None,
    monitor: ProgressMonitor | None = None,
) -> Strategy:
    """Make a planner, a policy, or for ``auto`` what selects the better of both for each start.

    Without a name, the policy is the robust one, or the styled one with a style: that, its file, or
    ``planned``. The monitor shows and ends plans, and tells that no motion begins on the side of
    the ``origin``.
    """
    name = policy or (STYLED_POLICY if style else DEFAULT_POLICY)
    if method == POLICY:
        learned = LearnedRise(world, name, torque_limit=settings.torque_limit, name=name)
        return apply_style(learned, style, monitor)
    robot = world.robot
    records = load_track_record(robot) if method == "auto" else None
    planner = PlannedRise(world, settings=settings, keys=keys, monitor=monitor)
    if monitor and robot.imu_kind and (gap := planner.describe_gap(origin)):
        monitor.tell(gap)  # without an IMU, no rise begins
    known = StrategyId(POLICY, name)
    if records is None or not (records.knows(known) and robot.body.is_original) or robot.held:
        return planner
    learned = LearnedRise(world, name, torque_limit=settings.torque_limit, name=name)
    both = {StrategyId(PLAN): planner, known: apply_style(learned, style, monitor)}
    return StrategySelector(both, records)


def make_strategy(
    world: World,
    name: str,
    settings: PlannerSettings = DEFAULTS,
    *,
    database: MotionDatabase | None = None,
) -> Strategy:
    """Make a strategy by its name: `PLAN`, `STRAIGHT`, `NEAREST`, or a policy or its file."""
    if name == PLAN:
        return PlannedRise(world, database, settings)
    if name == STRAIGHT:
        return PlannedRise(world, database, replace(settings, planning=False, filtering=False))
    if name == NEAREST:
        return NearestMotion(world, database, torque_limit=settings.torque_limit)
    return LearnedRise(world, name, torque_limit=settings.torque_limit, name=name)


def apply_style(
    learned: LearnedRise, style: str | None, monitor: ProgressMonitor | None = None
) -> Strategy:
    """Let a policy follow a style by its name or file, or the curves of a plan (``planned``)."""
    if style is None:
        return learned
    limit = learned.torque_limit
    if style == PLANNED:
        settings = PlannerSettings(torque_limit=limit)
        planner = PlannedRise(learned.world, settings=settings, monitor=monitor)
        return StyledRise(learned, planner)
    return LearnedRise(
        learned.world, learned.policy, torque_limit=limit, name=learned.name, style=style
    )
