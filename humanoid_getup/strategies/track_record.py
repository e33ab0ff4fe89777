"""Track record: how often each strategy of a robot has ended in a held stand.

The file is ``policies/records.toml`` in the robot's folder, one table per strategy and torque
limit. A class that was not measured is left out, and so is ``limit_by`` at the servos' full
torque, where all kinds of limits are the same::

    [[record]]
    method = "plan"        # or "policy"
    torque_limit = 2.5     # of every servo [N·m]
    supine = { stood = 248, n = 250 }
    prone = { stood = 249, n = 250 }

    [[record]]
    method = "policy"
    policy = "robust"      # name; with method "policy" only
    torque_limit = 2.5
    limit_by = "pwm"       # what the limit acts on: "current", "pwm" or "ideal"
    supine = { stood = 240, n = 250 }
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.starts.falls import CLASSES
from robots import Robot, TorqueLimit
from robots.servo import LimitMode
from robots.storage.validation import load_toml, positive, read_table, whole

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
    """The measured success of a robot's strategies."""

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
    """Load a robot's track record; without a file it is empty.

    Raises:
        ValueError: naming every problem of the file.
    """
    file = robot.folder / RECORDS
    if not file.exists():
        return TrackRecord()
    problems: list[str] = []
    try:
        found = read_table(TrackRecord, load_toml(file), "", problems)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error
    for number, record in enumerate(found.records, start=1):
        problems += [f"record number {number}: {problem}" for problem in _find_problems(record)]
    if problems:
        raise ValueError(f"{file}: {'; '.join(problems)}")
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
