"""Statistics that the benchmarks share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Self

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

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
    def of(cls, rises: Sequence[Any], **others: Any) -> Self:
        """Summarize rises, by their figures of the same names; ``others`` are further fields."""
        for field in msgspec.structs.fields(RiseSummary):
            if field.name not in ("n", "stood_interval_95"):
                values = [getattr(rise, field.name) for rise in rises]
                spreads = field.type is Quantiles
                others[field.name] = summarize(values) if spreads else sum(v or 0 for v in values)
        n = len(rises)
        return cls(n=n, stood_interval_95=wilson_interval(others["stood"], n), **others)


class PolicySummary(msgspec.Struct, frozen=True, kw_only=True):
    """Success, time, load and style errors of rises by a policy."""

    n: int
    stood: int
    stood_interval_95: tuple[float, float]
    stood_paper: int | UnsetType = UNSET
    """Those that stand as [Frezzato22] counts: 3 s from the end of the given curves on, without a
    restart."""
    followed: int | UnsetType = UNSET
    """Those that stood and followed the given curves, which are the nearest, to their end."""
    nearest: dict[str, int] = {}
    """Of those that stood, how many came nearest to the given curves and to each named style."""
    stand_time_s: Quantiles
    rms_torque_nm: Quantiles
    peak_torque_nm: Quantiles
    peak_braking_torque_nm: Quantiles
    head_impact_m_s: Quantiles
    height_error: Quantiles
    angle_error_deg: Quantiles
    restarts: Quantiles
    standing_joint_speed_rad_s: Quantiles


class PolicyClasses(msgspec.Struct, frozen=True, kw_only=True):
    """Rises by a policy, by class and over all."""

    classes: dict[str, PolicySummary]
    all: PolicySummary


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
