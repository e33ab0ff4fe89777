"""Plot of what planning costs, with more obstacles and more joints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes

Cases = list[dict[str, Any]]
MILLISECONDS = 1e3  # of a second


def save_planner_cost(result: dict[str, Any], path: Path) -> None:
    """Plot the results of `measure_planner_cost.py` over the number of obstacles, as PNG.

    One line for each number of joints: planning time, from the median to the 95th percentile;
    the share of problems solved; and the time of a check, beside MuJoCo's part of it.
    """
    cases: Cases = list(result["cases"].values())
    counts = sorted({case["obstacles"] for case in cases})
    figure = make_figure(10.0, 3.2)
    axes: list[Axes] = list(figure.subplots(1, 3))
    for number, joints in enumerate(sorted({case["joints"] for case in cases})):
        ours = [case for case in cases if case["joints"] == joints]
        at = np.array([counts.index(case["obstacles"]) for case in ours])
        _plot_times(axes[0], at, ours, f"{joints} joints")
        found = [100.0 * case["found"] / case["n"] for case in ours]
        axes[1].plot(at, found, marker="o", markersize=9 - 3 * number, linewidth=1.1)
        check, bare = ([case[key].median for case in ours] for key in ("check_us", "bare_us"))
        (line,) = axes[2].plot(at, check, marker="o", markersize=3, linewidth=1.1)
        axes[2].plot(at, bare, color=line.get_color(), linestyle="--", linewidth=0.9)
    axes[0].set(yscale="log", ylabel="planning time, median to p95 [ms]")
    axes[0].legend(fontsize=8, frameon=False)
    axes[1].set(ylabel=f"problems solved, of {result['n']} each [%]", ylim=(-4.0, 106.0))
    axes[2].set(ylabel="check, MuJoCo alone -- [µs]", ylim=(0.0, None))
    for axis in axes:
        axis.set_xticks(range(len(counts)), [str(count) for count in counts])
        axis.set_xlabel("obstacles")
        open_frame(axis)
    save_figure(figure, path)


def _plot_times(axis: Axes, at: np.ndarray, cases: Cases, label: str) -> None:
    median, p95 = (
        np.array([MILLISECONDS * getattr(case["time_s"], key) for case in cases])
        for key in ("median", "p95")
    )
    (line,) = axis.plot(at, median, marker="o", markersize=3, linewidth=1.1, label=label)
    axis.fill_between(at, median, p95, color=line.get_color(), alpha=0.12, linewidth=0)
