"""Figures of a benchmark's rises that do not depend on the clock."""

from __future__ import annotations

import json
from typing import Any

WALL_TIMES = ("plan_s", "filter_s", "late_p99_s", "busy_p99_s")
"""Figures of a rise that depend on the machine and its load, and on nothing else."""


def read_rises(text: str) -> list[dict[str, Any]]:
    """Read the rises of a benchmark without the wall times of their plans."""
    return drop_wall_times(json.loads(text)["rises"])


def drop_wall_times(value: Any) -> Any:
    """Return the figures of a benchmark without those that depend on the clock."""
    if isinstance(value, dict):
        return {k: drop_wall_times(v) for k, v in value.items() if k not in WALL_TIMES}
    if isinstance(value, list):
        return [drop_wall_times(one) for one in value]
    return value
