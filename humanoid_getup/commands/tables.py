"""Figures for people: bars that count, cells of tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


@contextmanager
def counting(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar on standard error; yield what moves it on by some."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        bar = progress.add_task(what, total=total)
        yield lambda done: progress.advance(bar, done)


def format_figure(value: Any) -> str:
    """Write a figure, an interval, or a median with its 95th percentile, for people."""
    if isinstance(value, dict):
        return f"{format_figure(value['median'])} (p95 {format_figure(value['p95'])})"
    if isinstance(value, list | tuple):
        return " to ".join(map(format_figure, value))
    return f"{value:.2f}" if isinstance(value, float) else str(value)
