"""A part of a long benchmark, which is run, stored and resumed as a unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import msgspec

from humanoid_getup.benchmarks.bench_result import KeptRise, RefusableSummary
from humanoid_getup.benchmarks.motions import MotionSummary


class MethodRises(msgspec.Struct, frozen=True, kw_only=True):
    """The rises of a method under a cap."""

    classes: tuple[str, ...]
    missing: dict[str, str]
    """Classes in which the robot does not come to lie, and why they were left out."""
    rises: list[KeptRise]
    """Stored figures of each rise."""


class DisturbedRises(msgspec.Struct, frozen=True, kw_only=True):
    """The rises under a disturbance."""

    cases: dict[str, RefusableSummary]


Step = Callable[[object], None]
"""Called after each step of a part, with its result."""
PartResult = MethodRises | MotionSummary | DisturbedRises


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a benchmark, not yet run."""

    name: str
    """Its name, also that of its file."""
    count: int
    """Number of steps that it reports."""
    depends: Mapping[str, object]
    """Inputs on which its result depends."""
    kind: type[PartResult]
    """Type of its result."""
    run: Callable[[Step], PartResult]
    """Runs it; reports each step."""
