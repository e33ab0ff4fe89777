"""Plots of a rise, of styles, and of a flight log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drivers.flight_log.reader import FlightRecord
from drivers.state import Integers
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.torque import limit_torque
from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure
from humanoid_getup.style.curves import PLACES
from humanoid_getup.style.style import Style
from robots import Robot
from robots.quaternion import Array

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMED = 6  # joints that get a color and a name
STANDING_SHOWN = 1.5  # s of the stand that are drawn
PANEL = 2.1  # inches of height
ALARMING = ("fault", "exception")  # kinds of events
MILLISECONDS = 1e3


def save_torque(
    robot: Robot, outcome: Outcome, torque_limit: float | None, path: Path, *, title: str = ""
) -> None:
    """Plot the driving torque of every servo, and its limit, over time, as PNG.

    The joints that came nearest to their limits are named, the others gray. Torque of servos that
    are turned from outside, which no limit by PWM holds for, is one dotted line, the largest of
    all. The torque limit [N·m] is that of every servo, None for their own.
    """
    torques = outcome.torques
    torque, braking = torques.driving, torques.braking.max(axis=1, initial=0.0)  # (T, n), (T,)
    limit = limit_torque(robot, torque_limit)
    time = np.arange(1, len(torque) + 1, dtype=float) * robot.control_period
    named = _find_largest(torque / limit)[::-1]
    figure = make_figure(8.0, 3.4)
    axis = figure.add_subplot()
    _plot_joints(axis, time, torque, named, robot.joint_names)
    axis.plot(time, braking, color="black", linestyle=":", linewidth=0.7, label="braking, any")
    end = time[-1]
    for value in np.unique(limit):
        axis.axhline(value, color="black", linestyle="--", linewidth=0.9)
        label = f"limit {value:.1f} N·m"
        axis.annotate(label, (0.0, value), (4, 3), textcoords="offset points", fontsize=8)
    if outcome.stood:
        begin = float(outcome.stand_time)
        end = min(end, begin + STANDING_SHOWN)
        axis.axvspan(begin, time[-1], color="tab:green", alpha=0.08)
        axis.text(
            begin, 0.98, " stands", transform=axis.get_xaxis_transform(), va="top", fontsize=8
        )
    axis.set(xlabel="time [s]", ylabel="servo torque [N·m]", xlim=(0.0, end))
    axis.set_title(title, fontsize=10, parse_math=False)
    axis.set_ylim(0.0, 1.15 * max(limit.max(), torque.max(), braking.max()))
    open_frame(axis)
    handles, labels = axis.get_legend_handles_labels()
    legend = figure.legend(
        handles[::-1], labels[::-1], loc="outside right upper", fontsize=8, frameon=False
    )
    legend.set_title("most loaded")
    legend.get_title().set_fontsize(8)
    save_figure(figure, path)


def draw_flight(record: FlightRecord) -> Figure:
    """Plot a flight log over time: tracking errors, load, heat, ages and timing.

    The joints with the largest values are named. The log has at least one cycle.
    """
    time = record.time - record.time[0]
    limp = record.sent["torque_limit"] == 0.0
    error = np.where(limp, np.nan, record.sent["joint_pos"] - record.state["joint_pos"])
    figure = make_figure(10.4, 4 * PANEL)
    axes: list[Axes] = list(figure.subplots(4, 1, sharex=True))
    _plot_joints(axes[0], time, np.degrees(error), _find_largest(error), record.joint_names)
    axes[0].set_ylabel("target - angle [°]")
    current = record.state["joint_current"]
    _plot_joints(axes[1], time, current, _find_largest(current), record.joint_names)
    axes[1].set_ylabel("motor current [A]")
    axes[2].plot(time, record.state["temperature"].max(axis=1), color="tab:red", linewidth=1.1)
    axes[2].set_ylabel("hottest servo [°C]")
    _plot_timing(axes[3], record, time)
    for axis in axes:
        for event in record.events:
            color = "tab:red" if event.kind in ALARMING else "tab:purple"
            axis.axvline(event.time - record.time[0], color=color, linestyle=":", linewidth=0.9)
        open_frame(axis)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8, frameon=False)
    axes[-1].set(xlabel="time [s]", xlim=(0.0, max(float(time[-1]), 1e-3)))
    return figure


def _find_largest(values: Array) -> Integers:
    """Return the columns of (T, n) that reach furthest from 0, largest first."""
    return np.argsort(np.nan_to_num(np.abs(values)).max(axis=0))[::-1][:NAMED]


def _plot_joints(
    axis: Axes, time: Array, values: Array, named: Integers, joint_names: tuple[str, ...]
) -> None:
    for joint in set(range(len(joint_names))) - set(named.tolist()):
        axis.plot(time, values[:, joint], color="0.85", linewidth=0.7)
    for joint in named:
        axis.plot(time, values[:, joint], linewidth=1.1, label=joint_names[joint])


def _plot_timing(axis: Axes, record: FlightRecord, time: Array) -> None:
    """Plot ages and the loop's times if the log has them, else the jitter of the cycles."""
    curves: dict[str, Array] = {"jitter": np.diff(time, prepend=-record.period) - record.period}
    if "joint_age" in record.state:
        curves["oldest joint"] = record.state["joint_age"].max(axis=1)
        curves["IMU age"] = record.state["imu_age"]
    if timing := record.tracks.get("timing"):
        curves |= {name.removesuffix("_s"): values for name, values in timing.columns.items()}
    for name, values in curves.items():
        axis.plot(time[-len(values) :], MILLISECONDS * values, linewidth=0.9, label=name)
    axis.set_ylabel("age, time [ms]")


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
    _finish_styles(figure, axes, longest)
    save_figure(figure, file, dpi=DPI)


def draw_followed(record: FlightRecord, *, title: str = "") -> Figure | None:
    """Plot the style that a policy followed in a flight; None if it followed none."""
    guidance = record.tracks.get("guidance")
    if guidance is None:
        return None
    time = record.time[np.searchsorted(record.state.cycle, guidance.cycle)] - record.time[0]
    figure = make_figure(WIDTH, HEIGHT)
    axes = figure.subplots(1, len(LABELS))
    # Between attempts nothing was followed: a gap, not a line across it.
    paused = np.append(np.diff(time) > PAUSE, False)[:, np.newaxis]
    for name, color, line in (("wanted", "black", "--"), ("measured", "C0", "-")):
        features = _in_units(np.where(paused, np.nan, guidance[name]))
        for k, axis in enumerate(axes):
            axis.plot(time, features[:, k], line, color=color, label=name)
    figure.suptitle(title, fontsize=10)
    _finish_styles(figure, axes, float(time[-1]))
    return figure


def _in_units(features: Array) -> Array:
    return features * np.array([1.0, 180.0 / np.pi, 180.0 / np.pi])


def _finish_styles(figure: Figure, axes: Array, end: float) -> None:
    for axis, name, top in zip(axes, LABELS, (1.1, 180.0, 180.0), strict=True):
        axis.set(xlabel="time [s]", title=name, xlim=(0.0, end), ylim=(0.0, top))
        axis.title.set_fontsize(10)
        open_frame(axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
