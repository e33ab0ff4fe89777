"""A part of a benchmark that takes long: it is run, kept and resumed as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from humanoid_getup.benchmarks.bench_result import RefusableSummary
from humanoid_getup.benchmarks.motions import MotionSummary
from humanoid_getup.benchmarks.rise import Report


class MethodRises(msgspec.Struct, frozen=True, kw_only=True):
    """The rises of a method under a cap."""

    classes: tuple[str, ...]
    missing: dict[str, str]
    """Classes in which the robot does not come to lie, and why they were left out."""
    rises: list[dict[str, Any]]
    """What is kept of each."""


class DisturbedRises(msgspec.Struct, frozen=True, kw_only=True):
    """The rises under a disturbance."""

    cases: dict[str, RefusableSummary]


PartResult = MethodRises | MotionSummary | DisturbedRises


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a benchmark, not yet run."""

    name: str
    """Of its file, too."""
    count: int
    """Steps that it reports."""
    depends: Mapping[str, object]
    """What its result depends on."""
    kind: type[PartResult]
    """What its result is."""
    run: Callable[[Report], PartResult]
    """Runs it; reports each step."""
