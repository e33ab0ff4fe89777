"""Plot of a whole benchmark: stands and times of every method, over the torque caps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.benchmarks.whole import CapSummary
from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes

Cases = Sequence[CapSummary]
SPREAD = 0.08  # of the distance between two caps, between methods that would hide each other


def save_benchmark(cases: Cases, path: Path) -> None:
    """Plot the success of each method with 95 % intervals, and its times to stand, as PNG."""
    caps = list(dict.fromkeys(case.cap for case in cases))
    methods = list(dict.fromkeys(case.method for case in cases))
    figure = make_figure(9.0, 3.4)
    axes: list[Axes] = list(figure.subplots(1, 2))
    for number, method in enumerate(methods):
        ours = [case for case in cases if case.method == method]
        at = np.arange(len(caps)) + SPREAD * (number - 0.5 * (len(methods) - 1))
        _plot_stands(axes[0], at, ours, method)
        _plot_times(axes[1], at, ours)
    axes[0].set(ylabel="stood, 95 % interval [%]", ylim=(-4.0, 104.0))
    axes[1].set(ylabel="time to stand, median to p95 [s]", ylim=(0.0, None))
    for axis in axes:
        axis.set_xticks(range(len(caps)), caps)
        axis.set_xlabel("torque cap of every servo")
        open_frame(axis)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    save_figure(figure, path)


def _plot_stands(axis: Axes, at: np.ndarray, cases: Cases, label: str) -> None:
    rate = np.array([case.stood / case.n for case in cases])
    interval = np.array([case.stood_interval_95 for case in cases])  # (caps, 2)
    error = 100.0 * np.abs(interval - rate[:, None]).T
    axis.errorbar(at, 100.0 * rate, error, marker="o", markersize=4, linewidth=1.1, label=label)


def _plot_times(axis: Axes, at: np.ndarray, cases: Cases) -> None:
    """Plot times of the rises that stood; a cap under which none did has no point."""
    median, p95 = (
        np.array([getattr(case.stand_time_s, key) for case in cases], dtype=float)
        for key in ("median", "p95")
    )
    error = np.stack([np.zeros(len(at)), p95 - median])
    axis.errorbar(at, median, error, marker="o", markersize=4, linewidth=1.1)
