"""Figures of a benchmark's rises that do not depend on the clock."""

from __future__ import annotations

import json
from typing import Any

from humanoid_getup.benchmarks.bench_result import WALL_TIMES


def read_rises(text: str) -> list[dict[str, Any]]:
    """Read the rises of a benchmark without the wall times of their plans."""
    rises = json.loads(text)["rises"]
    return [{k: v for k, v in one.items() if k not in WALL_TIMES} for one in rises]
