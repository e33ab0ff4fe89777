"""Track record: how often each way of getting up has ended in a held stand.

A robot's records are in ``policies/records.toml`` of its folder, one table for each way and
torque limit. A class may be left out if it was not measured, and ``cap`` if both kinds of
torque limit are the same, that is, at the full torque of the servos::

    [[record]]
    method = "plan"        # or "policy"
    torque_limit = 2.5     # of every servo [N·m]
    supine = { stood = 248, n = 250 }
    prone = { stood = 249, n = 250 }

    [[record]]
    method = "policy"
    policy = "robust"      # which; with method "policy" only
    torque_limit = 2.5
    cap = "pwm"            # limited by voltage as in position mode, or "torque"
    supine = { stood = 240, n = 250 }
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from humanoid_getup.evaluation.statistics import wilson_interval
from humanoid_getup.simulation.falls import CLASSES
from robots import Robot
from robots.validation import load_toml, positive, read_table, whole

PLAN, POLICY = "plan", "policy"
BY_TORQUE, BY_PWM = "torque", "pwm"
RECORDS = Path("policies", "records.toml")
LIMIT_SLACK = 1e-9  # N·m
MOST_TORQUE, MOST_RISES = 1000.0, 10**9


class RecordsError(ValueError):
    """A file does not hold records; the message names all that is wrong with it."""


@dataclass(frozen=True)
class Way:
    """A way of getting up."""

    method: str
    """`PLAN` or `POLICY`."""
    policy: str = ""
    """Name of the policy; empty for plans."""


@dataclass(frozen=True)
class Count:
    """How many of some rises ended in a held stand."""

    stood: Annotated[int, whole(0, MOST_RISES)]
    n: Annotated[int, whole(1, MOST_RISES)]


@dataclass(frozen=True)
class Record:
    """Results of one way under one torque limit."""

    way: Way
    torque_limit: float
    """Torque limit of every servo [N·m]."""
    counts: Mapping[str, Count]
    """By the class of the start."""
    cap: str | None = None
    """`BY_TORQUE` or `BY_PWM`; None if both are the same."""


@dataclass(frozen=True)
class TrackRecord:
    """Measured results of a robot's ways of getting up."""

    records: tuple[Record, ...] = ()

    def knows(self, way: Way) -> bool:
        """Return whether a way was measured at all."""
        return any(record.way == way for record in self.records)

    def promise(
        self, way: Way, start_class: str, torque_limit: float, cap: str = BY_TORQUE
    ) -> float:
        """Return the share of stands that a way can be trusted to reach, from 0 to 1.

        It is the lower end of the 95 % interval, so that few rises promise little. A robot
        with stronger servos gets up no worse: the record with the highest torque limit [N·m]
        up to the requested one counts. Without such a record the share is 0.
        """
        fitting = [
            record
            for record in self.records
            if record.way == way
            and start_class in record.counts
            and record.torque_limit <= torque_limit + LIMIT_SLACK
            and record.cap in (None, cap)
        ]
        if not fitting:
            return 0.0
        count = max(fitting, key=lambda record: record.torque_limit).counts[start_class]
        return wilson_interval(count.stood, count.n)[0]


ClassCount = Annotated[Count, Meta(description="{ stood = ..., n = ... }")] | None


@dataclass(frozen=True, kw_only=True)
class _Row:
    """One table [[record]] of the file."""

    method: Literal["plan", "policy"]
    torque_limit: Annotated[float, positive(MOST_TORQUE, "N·m")]
    policy: str = ""
    cap: Literal["torque", "pwm"] | None = None
    supine: ClassCount = None
    prone: ClassCount = None
    left: ClassCount = None
    right: ClassCount = None


@dataclass(frozen=True, kw_only=True)
class _File:
    record: tuple[_Row, ...] = ()


def load_records(robot: Robot) -> TrackRecord:
    """Load a robot's track record, which is empty if it has no file.

    Raises:
        RecordsError: naming all that is wrong with the file.
    """
    file = robot.folder / RECORDS
    if not file.exists():
        return TrackRecord()
    problems: list[str] = []
    try:
        table = read_table(_File, load_toml(file), "", problems)
    except ValueError as error:
        raise RecordsError(f"{file}: {error}") from error
    records = [_build_record(row, i, problems) for i, row in enumerate(table.record, start=1)]
    if problems:
        raise RecordsError(f"{file}: {'; '.join(problems)}")
    return TrackRecord(tuple(records))


def _build_record(row: _Row, number: int, problems: list[str]) -> Record:
    if row.method == POLICY and not row.policy:
        problems.append(f"record number {number}: policy is missing, expected a text")
    counts = {name: getattr(row, name) for name in CLASSES if getattr(row, name) is not None}
    problems += [
        f"record number {number}: {name}.stood is {count.stood}, expected an integer from 0 to "
        f"{count.n}"
        for name, count in counts.items()
        if count.stood > count.n > 0
    ]
    way = Way(row.method, row.policy if row.method == POLICY else "")
    return Record(way, row.torque_limit, counts, row.cap)
