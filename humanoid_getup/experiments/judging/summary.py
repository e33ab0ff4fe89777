"""Statistics that the benchmarks share."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

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


def wilson_interval(successes: int, n: int) -> tuple[float, float]:
    """Compute the 95 % interval of a success rate, by Wilson's score."""
    if n == 0:
        return 0.0, 1.0
    rate, z2 = successes / n, Z95 * Z95
    center = (rate + z2 / (2 * n)) / (1 + z2 / n)
    half = Z95 / (1 + z2 / n) * math.sqrt(rate * (1 - rate) / n + z2 / (4 * n * n))
    return max(0.0, center - half), min(1.0, center + half)


def summarize(values: Iterable[float | None]) -> dict[str, float | None]:
    """Compute median and 95th percentile of the values that are numbers."""
    numbers = [v for v in values if v is not None and math.isfinite(v)]
    if not numbers:
        return {"median": None, "p95": None}
    return {"median": float(np.median(numbers)), "p95": float(np.percentile(numbers, 95))}


def summarize_records(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Summarize rises: counts, interval, times [s], load, faults."""
    stood = sum(bool(r["stood"]) for r in records)
    low, high = wilson_interval(stood, len(records))
    summary: dict[str, Any] = {
        "n": len(records),
        "planned": sum(bool(r["planned"]) for r in records),
        "stood": stood,
        "stood_interval_95": [low, high],
    }
    for key in SUMMARIZED:
        summary[key] = summarize(r.get(key) for r in records)
    for key in COUNTED:
        summary[key] = sum(r.get(key) or 0 for r in records)
    return summary
