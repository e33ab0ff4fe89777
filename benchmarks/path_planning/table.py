"""The results of a benchmark of planners: a table for people, JSON for programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from humanoid_getup.cli.shared.console import format_figure, make_table
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

SEARCH_FIGURES = ("n", "found", "found_interval_95", "time_s", "checks_median")
"""Figures of every search."""


def write_results(result: dict[str, Any], figures: tuple[str, ...], json: Path | None) -> None:
    """Print figures of every case as a table, and write all results as JSON if a file is named."""
    table = make_table((result["name"], *figures), left=(result["name"],))
    for name, case in result["cases"].items():
        table.add_row(name, *(format_figure(case[figure]) for figure in figures))
    Console().print(table)
    if json is not None:
        write_atomically(json, to_json(result))
