"""Track record: how often each strategy of a robot has ended in a held stand.

The file is ``policies/records.toml`` in the robot's folder, one table per strategy and torque
limit. A class may be left out where nothing was measured, and ``cap`` where both kinds of
limits are alike, at the servos' full torque::

    [[record]]
    method = "plan"        # or "policy"
    torque_limit = 2.5     # of every servo [N·m]
    supine = { stood = 248, n = 250 }
    prone = { stood = 249, n = 250 }

    [[record]]
    method = "policy"
    policy = "robust"      # which; with method "policy" only
    torque_limit = 2.5
    cap = "pwm"            # how the limit acts: "pwm" or "torque"
    supine = { stood = 240, n = 250 }
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

from humanoid_getup.evaluation.statistics import wilson_interval
from humanoid_getup.simulation.falls import CLASSES
from robots import Robot, TorqueLimit
from robots.schema import Fields
from robots.torque_limit import LimitedBy
from robots.validation import shown

PLAN, POLICY = "plan", "policy"
RECORDS = Path("policies", "records.toml")
LIMIT_SLACK = 1e-9  # N·m
MOST_TORQUE, MOST_RISES = 1000.0, 10**9


class RecordsError(ValueError):
    """A file is not a valid track record; the message names every problem."""


@dataclass(frozen=True)
class StrategyId:
    """Which strategy: plans, or one policy."""

    method: str
    """`PLAN` or `POLICY`."""
    policy: str = ""
    """Name of the policy; empty for plans."""


@dataclass(frozen=True)
class StandCount:
    """How many of a number of rises ended in a held stand."""

    stood: int
    n: int


@dataclass(frozen=True)
class StrategyRecord:
    """How often one strategy succeeded under one torque limit."""

    strategy: StrategyId
    torque_limit: float
    """Of every servo [N·m]."""
    counts: Mapping[str, StandCount]
    """By start class."""
    limited_by: LimitedBy | None = None
    """How the limit acted; None where both ways are alike."""


@dataclass(frozen=True)
class TrackRecord:
    """The measured success of a robot's strategies."""

    records: tuple[StrategyRecord, ...] = ()

    def knows(self, strategy: StrategyId) -> bool:
        """Return whether a strategy was measured at all."""
        return any(record.strategy == strategy for record in self.records)

    def success(self, strategy: StrategyId, start_class: str, torque_limit: TorqueLimit) -> float:
        """Return the share of held stands to expect of a strategy, from 0 to 1.

        It is the lower end of the 95 % interval, so that few rises count for little. A robot
        with stronger servos gets up no worse: what counts is the record with the highest
        torque limit that is not above the given one. Without such a record the share is 0.
        """
        limit = math.inf if torque_limit.value is None else torque_limit.value
        fitting = [
            record
            for record in self.records
            if record.strategy == strategy
            and start_class in record.counts
            and record.torque_limit <= limit + LIMIT_SLACK
            and record.limited_by in (None, torque_limit.by)
        ]
        if not fitting:
            return 0.0
        count = max(fitting, key=lambda record: record.torque_limit).counts[start_class]
        return wilson_interval(count.stood, count.n)[0]


def load_track_record(robot: Robot) -> TrackRecord:
    """Load a robot's track record; without a file it is empty.

    Raises:
        RecordsError: naming every problem of the file.
    """
    file = robot.folder / RECORDS
    if not file.exists():
        return TrackRecord()
    faults: list[str] = []
    try:
        tables = tomllib.loads(file.read_text("utf-8")).get("record", [])
    except ValueError as error:
        raise RecordsError(f"{file}: {error}") from error
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise RecordsError(f"{file}: record is {shown(tables)}, expected tables [[record]]")
    records = [_read(table, f"record {i}: ", faults) for i, table in enumerate(tables, start=1)]
    if faults:
        raise RecordsError(f"{file}: {'; '.join(faults)}")
    return TrackRecord(tuple(records))


def _read(table: dict[str, Any], owner: str, faults: list[str]) -> StrategyRecord:
    fields = Fields(table, owner, faults)
    method = fields.choice("method", (PLAN, POLICY))
    strategy = StrategyId(method, fields.text("policy") if method == POLICY else "")
    torque_limit = fields.number("torque_limit", MOST_TORQUE, "N·m")
    counts = {}
    for name in CLASSES:
        if name in table:
            counts[name] = _count(table[name], f"{owner}{name}", faults)
    limited_by = fields.choice("cap", get_args(LimitedBy)) if "cap" in table else None
    return StrategyRecord(strategy, torque_limit, counts, cast("LimitedBy | None", limited_by))


def _count(value: Any, owner: str, faults: list[str]) -> StandCount:
    if not isinstance(value, dict):
        faults.append(f"{owner} is {shown(value)}, expected {{ stood = ..., n = ... }}")
        return StandCount(0, 0)
    fields = Fields(value, f"{owner}.", faults)
    n = fields.integer("n", 1, MOST_RISES)
    return StandCount(fields.integer("stood", 0, max(n, 0)), n)
