"""Plots of style curves: of styles, and of a robot that followed them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure
from humanoid_getup.style.curves import PLACES
from humanoid_getup.style.style import Style
from robots.quaternion import Array

if TYPE_CHECKING:  # matplotlib and mcap are slow to import
    from matplotlib.figure import Figure

    from drivers.flight_log.reader import FlightRecord

LABELS = ("neck height [share of standing]", "side angle [deg]", "front angle [deg]")
SAMPLES = 201
PAUSE = 0.5  # s without a target, after which lines are interrupted
WIDTH, HEIGHT, DPI = 10.0, 3.2, 110  # inches, dots per inch


def save_styles(styles: Sequence[Style], file: Path) -> None:
    """Plot styles over time [s], as PNG; means are over curves at equal shares of their durations.

    A style of several curves is its mean with a band of a standard deviation on both sides, as in
    [Frezzato22], figure 8; one of a single curve has its control points marked.
    """
    figure = make_figure(WIDTH, HEIGHT)
    axes = figure.subplots(1, len(LABELS))
    share = np.linspace(0.0, 1.0, SAMPLES)
    longest = 0.0
    for number, style in enumerate(styles):
        color = f"C{number}"
        rows = np.array([_in_units(curve.sample(share * curve.duration)) for curve in style.curves])
        mean, deviation = rows.mean(axis=0), rows.std(axis=0)
        duration = float(np.mean([curve.duration for curve in style.curves]))
        time, longest = share * duration, max(longest, duration)
        label = style.name if len(rows) == 1 else f"{style.name} ({len(rows)} curves)"
        for k, axis in enumerate(axes):
            axis.plot(time, mean[:, k], color=color, label=label)
            if len(rows) > 1:
                low, high = mean[:, k] - deviation[:, k], mean[:, k] + deviation[:, k]
                axis.fill_between(time, low, high, color=color, alpha=0.15, linewidth=0)
            else:
                points = _in_units(style.curves[0].points)[:, k]
                axis.plot(PLACES * duration, points, "o", color=color, markersize=3)
    _finish(figure, axes, longest)
    save_figure(figure, file, dpi=DPI)


def save_following(
    time: Array, wanted: Array, measured: Array, file: Path, *, title: str = ""
) -> None:
    """Plot wanted and measured features, (T, 3) each, over time [s], as PNG."""
    figure = make_figure(WIDTH, HEIGHT)
    axes = figure.subplots(1, len(LABELS))
    for k, axis in enumerate(axes):
        axis.plot(time, _in_units(wanted)[:, k], "--", color="black", label="wanted")
        axis.plot(time, _in_units(measured)[:, k], color="C0", label="measured")
    figure.suptitle(title, fontsize=10)
    _finish(figure, axes, float(time[-1]))
    save_figure(figure, file, dpi=DPI)


def save_flight(record: FlightRecord, file: Path, *, title: str = "") -> None:
    """Plot the style that a policy followed in a flight, as PNG, if it followed any."""
    guidance = record.tracks.get("guidance")
    if guidance is None:
        return
    time = record.time[np.searchsorted(record.state.cycle, guidance.cycle)] - record.time[0]
    wanted, measured = guidance["wanted"].copy(), guidance["measured"].copy()
    # Between attempts nothing was followed: a gap, not a line across it.
    paused = np.flatnonzero(np.diff(time) > PAUSE)
    for features in (wanted, measured):
        features[paused] = np.nan
    save_following(time, wanted, measured, file, title=title)


def _in_units(features: Array) -> Array:
    return features * np.array([1.0, 180.0 / np.pi, 180.0 / np.pi])


def _finish(figure: Figure, axes: Array, end: float) -> None:
    for axis, name, top in zip(axes, LABELS, (1.1, 180.0, 180.0), strict=True):
        axis.set(xlabel="time [s]", title=name, xlim=(0.0, end), ylim=(0.0, top))
        axis.title.set_fontsize(10)
        open_frame(axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
