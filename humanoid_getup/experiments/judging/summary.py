"""Statistics that the benchmarks share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import msgspec
import numpy as np

SUMMARIZED = (
    "stand_time_s",
    "plan_s",
    "filter_s",
    "torque_use",
    "peak_torque_nm",
    "rms_torque_nm",
    "head_impact_m_s",
)
COUNTED = ("self_collisions", "ground_penetrations", "limit_violations", "clips")
Z95 = 1.959964  # quantile of the normal distribution


class Quantiles(msgspec.Struct, frozen=True, kw_only=True):
    """Median and 95th percentile of values; None without any."""

    median: float | None = None
    p95: float | None = None


class RiseSummary(msgspec.Struct, frozen=True, kw_only=True):
    """Success, time, load and contacts of the rises of a case."""

    n: int
    planned: int
    stood: int
    stood_interval_95: tuple[float, float]
    stand_time_s: Quantiles
    plan_s: Quantiles
    filter_s: Quantiles
    torque_use: Quantiles
    peak_torque_nm: Quantiles
    rms_torque_nm: Quantiles
    head_impact_m_s: Quantiles
    self_collisions: int
    ground_penetrations: int
    limit_violations: int
    clips: int

    @classmethod
    def of(cls, records: Sequence[Mapping[str, Any]], **others: Any) -> Self:
        """Summarize the records of rises; ``others`` are further fields."""
        stood = sum(bool(r["stood"]) for r in records)
        figures: dict[str, Any] = {key: sum(r.get(key) or 0 for r in records) for key in COUNTED}
        figures |= {key: summarize(r.get(key) for r in records) for key in SUMMARIZED}
        return cls(
            n=len(records),
            planned=sum(bool(r["planned"]) for r in records),
            stood=stood,
            stood_interval_95=wilson_interval(stood, len(records)),
            **(figures | others),
        )


def wilson_interval(successes: int, n: int) -> tuple[float, float]:
    """Compute the 95 % interval of a success rate, by Wilson's score."""
    if n == 0:
        return 0.0, 1.0
    rate, z2 = successes / n, Z95 * Z95
    center = (rate + z2 / (2 * n)) / (1 + z2 / n)
    half = Z95 / (1 + z2 / n) * math.sqrt(rate * (1 - rate) / n + z2 / (4 * n * n))
    return max(0.0, center - half), min(1.0, center + half)


def summarize(values: Iterable[float | None]) -> Quantiles:
    """Compute median and 95th percentile of the values that are numbers."""
    numbers = [v for v in values if v is not None and math.isfinite(v)]
    if not numbers:
        return Quantiles()
    return Quantiles(median=float(np.median(numbers)), p95=float(np.percentile(numbers, 95)))
