"""Plot of a sweep: the share of rises that stood, along what was varied."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.benchmarks.sweep.swept_design import (
    HALF,
    Coordinate,
    Sweep,
    SweptDesign,
    group_cases,
    list_numeric,
)
from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes

MOST_PANELS, MOST_LINES = 6, 8
OWN = "as it is"
STOOD = "stood, 95 % interval [%]"


def save_sweep(result: Sweep, path: Path) -> None:
    """Plot a sweep as PNG: a map over two numeric axes, lines over one, else a bar a design.

    What is varied besides has a panel or a line each, the first ones if there are many.
    """
    cases, numeric = [*result.cases.values()], list_numeric(result.axes)
    if len(numeric) >= 2:
        _plot_maps(result, cases, numeric[0], numeric[1], path)
    elif numeric:
        _plot_lines(result, cases, numeric[0], path)
    else:
        _plot_bars(result, path)


def _plot_maps(
    result: Sweep, cases: Sequence[SweptDesign], across: str, up: str, path: Path
) -> None:
    others = [axis for axis in result.axes if axis not in (across, up)]
    groups = [*group_cases(cases, others).items()][:MOST_PANELS]
    figure = make_figure(1.0 + 4.2 * len(groups), 3.8)
    panels: list[Axes] = list(np.atleast_1d(figure.subplots(1, len(groups))))
    columns, rows = (sorted(map(_to_number, result.axes[axis])) for axis in (across, up))
    for panel, (place, some) in zip(panels, groups, strict=True):
        share = np.full((len(rows), len(columns)), np.nan)
        for one in some:
            at = one.coordinates
            k, m = rows.index(_to_number(at[up])), columns.index(_to_number(at[across]))
            share[k, m] = one.share
            dark = one.share < HALF
            panel.text(
                m, k, f"{one.stood}/{one.n}", ha="center", va="center", fontsize=7,
                color="white" if dark else "black",
            )  # fmt: skip
        panel.imshow(share, vmin=0.0, vmax=1.0, cmap="viridis", origin="lower", aspect="auto")
        panel.set_xticks(range(len(columns)), [f"{x:g}" for x in columns])
        panel.set_yticks(range(len(rows)), [f"{y:g}" for y in rows])
        panel.set(xlabel=across, ylabel=up, title=name_place(place, others))
    save_figure(figure, path)


def _plot_lines(result: Sweep, cases: Sequence[SweptDesign], across: str, path: Path) -> None:
    others = [axis for axis in result.axes if axis != across]
    figure = make_figure(6.4, 3.6)
    axis = figure.subplots()
    for place, some in [*group_cases(cases, others).items()][:MOST_LINES]:
        some = sorted(some, key=lambda one: _to_number(one.coordinates[across]))
        at = [_to_number(one.coordinates[across]) for one in some]
        share = np.array([one.share for one in some])
        interval = np.array([one.stood_interval_95 for one in some])  # (designs, 2)
        error = 100.0 * np.abs(interval - share[:, None]).T
        axis.errorbar(
            at, 100.0 * share, error, marker="o", markersize=4, linewidth=1.1,
            label=name_place(place, others) or None,
        )  # fmt: skip
    axis.axhline(100.0 * HALF, color="0.7", linewidth=0.8, zorder=0)
    axis.set(xlabel=across, ylabel=STOOD, ylim=(-4.0, 104.0))
    open_frame(axis)
    if others:
        axis.legend(fontsize=8, frameon=False)
    save_figure(figure, path)


def _plot_bars(result: Sweep, path: Path) -> None:
    names, cases = [*result.cases], [*result.cases.values()]
    figure = make_figure(6.4, 1.2 + 0.3 * len(cases))
    axis = figure.subplots()
    share = np.array([one.share for one in cases])
    interval = np.array([one.stood_interval_95 for one in cases])
    axis.barh(names, 100.0 * share, xerr=100.0 * np.abs(interval - share[:, None]).T, color="0.6")
    axis.set(xlabel=STOOD, xlim=(0.0, 104.0))
    axis.invert_yaxis()
    open_frame(axis)
    save_figure(figure, path)


def name_place(place: tuple[Coordinate, ...], axes: Sequence[str]) -> str:
    """Name a place on some axes."""
    return ", ".join(
        f"{axis} {x:g}" if isinstance(x, float) else str(x or OWN)
        for x, axis in zip(place, axes, strict=True)
    )


def _to_number(value: Coordinate) -> float:
    return float(value or 0.0)
