"""Results of benchmarks: a common head, and the figures of each case."""

from __future__ import annotations

from abc import ABCMeta, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from msgspec import UNSET, Struct, StructMeta, UnsetType

from humanoid_getup.engines.versions import Versions
from humanoid_getup.execution.result import RiseFigures, RiseResult
from humanoid_getup.experiments.judging.summary import RiseSummary, SummarizedRise
from robots.servo import LimitMode

Case = TypeVar("Case")


@dataclass(frozen=True, kw_only=True)
class KeptRise(SummarizedRise):
    """Stored figures of a rise in a benchmark with many rises."""

    bench_class: str | UnsetType = UNSET
    """Class of the fall; unset where rises are identified by other fields."""
    start_class: str | None
    reason: str
    attempts: int


WALL_TIMES = ("plan_s", "filter_s", "late_p99_s", "busy_p99_s")
"""Figures of a rise that depend on the machine and its load, and on nothing else."""


@dataclass(frozen=True, kw_only=True)
class MeasuredRise(RiseFigures, KeptRise):
    """One rise of a benchmark; unset fields are not needed to identify it."""

    way: str | UnsetType = UNSET
    case: str | UnsetType = UNSET
    fall: int | UnsetType = UNSET
    """Number of the fall."""
    refused: bool | UnsetType = UNSET
    """Whether nothing was played."""

    @classmethod
    def refusable(cls, rise: RiseResult, *, case: str, way: str, fall: int) -> MeasuredRise:
        """Label a rise that the preflight may have refused."""
        refused = rise.run is None
        return cls(**vars(rise.figures()), case=case, way=way, fall=fall, refused=refused)


class AbstractStructMeta(StructMeta, ABCMeta):
    """Metaclass of structs with abstract methods."""


class BenchHead(Struct, metaclass=AbstractStructMeta, frozen=True, kw_only=True):
    """Head of a result: benchmark, robot and conditions; JSON omits unset fields."""

    name: str
    seed: int
    n: int
    robot: str | UnsetType = UNSET
    body: str | UnsetType = UNSET
    scene: str | UnsetType = UNSET
    motion: str | UnsetType = UNSET
    torque_limit_nm: float | UnsetType | None = UNSET
    """None for stall torque."""
    limit_by: LimitMode | UnsetType | None = UNSET
    versions: Versions | UnsetType = UNSET
    """What the result depends on, by checksum, where workers may have made it."""

    @property
    @abstractmethod
    def table(self) -> Mapping[str, Any]:
        """Return the rows of its table."""


class CaseBench(BenchHead, Generic[Case], frozen=True, kw_only=True):
    """A benchmark of several cases."""

    cases: dict[str, Case]
    rises: list[MeasuredRise] | UnsetType = UNSET

    @property
    def table(self) -> Mapping[str, Any]:
        """Return the cases."""
        return self.cases


class RiseBench(BenchHead, frozen=True, kw_only=True):
    """A benchmark of one strategy, by start class."""

    planning: bool
    filtering: bool
    assistance: float
    prefer: str
    search_budget_s: float
    classes: dict[str, RiseSummary]
    all: RiseSummary
    rises: list[MeasuredRise]

    @property
    def table(self) -> Mapping[str, Any]:
        """Return the classes."""
        return self.classes


class RefusableSummary(RiseSummary, frozen=True, kw_only=True):
    """Rises of which the preflight may refuse some."""

    refused: int
    failures: list[str]
    """Fall and reason of each rise that did not stand."""

    @classmethod
    def table(
        cls, rises: Sequence[MeasuredRise], cases: Iterable[str], ways: Sequence[str]
    ) -> dict[str, RefusableSummary]:
        """Summarize the rises of each case by each way."""
        return {f"{case}: {way}": cls._select(rises, case, way) for case in cases for way in ways}

    @classmethod
    def _select(cls, rises: Sequence[MeasuredRise], case: str, way: str) -> RefusableSummary:
        ours = [rise for rise in rises if rise.case == case and rise.way == way]
        return cls.of(
            ours,
            refused=sum(bool(rise.refused) for rise in ours),
            failures=[f"fall {rise.fall}: {rise.reason}" for rise in ours if not rise.stood],
        )
