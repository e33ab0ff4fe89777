"""Cells and tables of pages in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from humanoid_getup.experiments.judging.summary import Quantiles, RiseSummary

NONE = "–"


def write_rate(case: RiseSummary | None) -> str:
    """Write how many rises stood, with the interval; a dash for none."""
    if case is None:
        return NONE
    return write_count(case.stood, case.n, case.stood_interval_95)


def write_count(stood: int, n: int, interval: Sequence[float]) -> str:
    """Write a count of n, with the interval of its share."""
    low, high = interval
    return f"{stood} of {n} ({low:.0%} to {high:.0%})"


def write_spread(value: Quantiles) -> str:
    """Write a median, with the 95th percentile."""
    if value.median is None:
        return NONE
    return f"{write_number(value.median)} ({write_number(value.p95)})"


def write_number(value: float | None) -> str:
    """Write a number with two decimals; a dash for none."""
    return NONE if value is None or math.isnan(value) else f"{value:.2f}"


def write_table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Write a Markdown table; vertical bars in cells are escaped."""
    lines = [tuple(headings), ("---",) * len(headings), *rows]
    cells = [[str(cell).replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)
