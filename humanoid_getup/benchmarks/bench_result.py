"""Results of benchmarks: a common head, and the figures of each case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from msgspec import UNSET, Struct, UnsetType

from humanoid_getup.experiments.judging.summary import Quantiles, RiseSummary
from robots.servo import LimitMode

Case = TypeVar("Case")


class BenchHead(Struct, frozen=True, kw_only=True):
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

    @property
    def table(self) -> Mapping[str, Any]:
        """Return the rows of its table."""
        raise NotImplementedError


class CaseBench(BenchHead, Generic[Case], frozen=True, kw_only=True):
    """A benchmark of several cases."""

    cases: dict[str, Case]
    rises: list[dict[str, Any]] | UnsetType = UNSET
    """The record of each rise."""

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
    rises: list[dict[str, Any]]
    """The record of each rise."""

    @property
    def table(self) -> Mapping[str, Any]:
        """Return the classes."""
        return self.classes


class MethodSummary(RiseSummary, frozen=True, kw_only=True):
    """Rises by one of several methods."""

    hottest_after_ten_rises_c: Quantiles | UnsetType = UNSET
    """Temperature of the hottest servo [°C]; unset where it is not measured."""


class RefusableSummary(RiseSummary, frozen=True, kw_only=True):
    """Rises of which the preflight may refuse some."""

    refused: int
    failures: list[str]
    """Fall and reason of each rise that did not stand."""

    @classmethod
    def table(
        cls, records: Sequence[dict[str, Any]], cases: Iterable[str], ways: Sequence[str]
    ) -> dict[str, RefusableSummary]:
        """Summarize the rises of each case by each way."""
        return {f"{case}: {way}": cls._select(records, case, way) for case in cases for way in ways}

    @classmethod
    def _select(cls, records: Sequence[dict[str, Any]], case: str, way: str) -> RefusableSummary:
        ours = [r for r in records if r["case"] == case and r["way"] == way]
        return cls.of(
            ours,
            refused=sum(r["refused"] for r in ours),
            failures=[f"fall {r['fall']}: {r['reason']}" for r in ours if not r["stood"]],
        )
