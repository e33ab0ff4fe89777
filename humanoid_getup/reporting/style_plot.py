"""Plots of style curves: those of styles, and those that a robot followed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.style.curves import PLACES
from humanoid_getup.style.style import Style
from robots.files import atomic_path
from robots.quaternion import Array

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.figure import Figure

LABELS = ("neck height [share of standing]", "side angle [deg]", "front angle [deg]")
SAMPLES = 201
WIDTH, HEIGHT = 10.0, 3.2  # inches


def save_styles(styles: Sequence[Style], file: Path) -> None:
    """Plot styles over the share of their durations, as PNG.

    A style of several curves is its mean with a band of a standard deviation on both sides, as in
    [Frezzato22], figure 8; one of a single curve has its control points marked.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
    axes = figure.subplots(1, len(LABELS))
    share = np.linspace(0.0, 1.0, SAMPLES)
    for number, style in enumerate(styles):
        color = f"C{number}"
        rows = np.array([_in_units(curve.sample(share * curve.duration)) for curve in style.curves])
        mean, deviation = rows.mean(axis=0), rows.std(axis=0)
        label = style.name if len(rows) == 1 else f"{style.name} ({len(rows)} curves)"
        for k, axis in enumerate(axes):
            axis.plot(share, mean[:, k], color=color, label=label)
            if len(rows) > 1:
                low, high = mean[:, k] - deviation[:, k], mean[:, k] + deviation[:, k]
                axis.fill_between(share, low, high, color=color, alpha=0.15, linewidth=0)
            else:
                points = _in_units(style.curves[0].points)[:, k]
                axis.plot(PLACES, points, "o", color=color, markersize=3)
    _finish(figure, axes, "share of the duration", 1.0)
    _save(figure, file)


def save_following(
    time: Array, wanted: Array, measured: Array, file: Path, *, title: str = ""
) -> None:
    """Plot wanted and measured features, (T, 3) each, over time [s], as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
    axes = figure.subplots(1, len(LABELS))
    for k, axis in enumerate(axes):
        axis.plot(time, _in_units(wanted)[:, k], "--", color="black", label="wanted")
        axis.plot(time, _in_units(measured)[:, k], color="C0", label="measured")
    figure.suptitle(title, fontsize=10)
    _finish(figure, axes, "time [s]", float(time[-1]))
    _save(figure, file)


def _in_units(features: Array) -> Array:
    return features * np.array([1.0, 180.0 / np.pi, 180.0 / np.pi])


def _finish(figure: Figure, axes: Array, label: str, end: float) -> None:
    for axis, name, top in zip(axes, LABELS, (1.1, 180.0, 180.0), strict=True):
        axis.set(xlabel=label, title=name, xlim=(0.0, end), ylim=(0.0, top))
        axis.title.set_fontsize(10)
        axis.spines[["top", "right"]].set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)


def _save(figure: Figure, file: Path) -> None:
    with atomic_path(file) as partial:
        figure.savefig(partial, format="png", dpi=110)
