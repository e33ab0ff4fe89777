"""Plots: what a rise asked of the servos."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from humanoid_getup.watch import Watched
from robots import Robot

NAMED = 6  # joints that get a colour and a name
STANDING_SHOWN = 1.5  # s of the stand that are drawn


def save_torque(
    robot: Robot, watched: Watched, torque_limit: float | None, path: Path, *, title: str = ""
) -> None:
    """Plot the size of every servo's torque against its limit over time, as PNG.

    The joints that came nearest to their limits are named, the others grey.

    Args:
        robot: Robot that was watched.
        watched: What happened.
        torque_limit: Cap on every servo [N·m].
        path: File to write.
        title: Of the plot.
    """
    torque = np.abs(watched.torque)  # (T, n)
    limit = robot.max_torque if torque_limit is None else np.minimum(robot.max_torque, torque_limit)
    time = np.arange(1, len(torque) + 1) * robot.control_period
    loaded = np.argsort((torque / limit).max(axis=0))[::-1]
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    axis = figure.add_subplot()
    for joint in loaded[NAMED:]:
        axis.plot(time, torque[:, joint], color="0.85", linewidth=0.7)
    for joint in loaded[:NAMED][::-1]:
        axis.plot(time, torque[:, joint], linewidth=1.1, label=robot.joint_names[joint])
    end = (
        min(time[-1], watched.stand.start_time + STANDING_SHOWN)
        if watched.stand.stood
        else time[-1]
    )
    for value in np.unique(limit):
        axis.axhline(value, color="black", linestyle="--", linewidth=0.9)
        label = f"limit {value:.1f} N·m"
        axis.annotate(label, (0.0, value), (4, 3), textcoords="offset points", fontsize=8)
    if watched.stand.stood:
        begin = watched.stand.start_time
        axis.axvspan(begin, time[-1], color="tab:green", alpha=0.08)
        axis.text(
            begin, 0.98, " stands", transform=axis.get_xaxis_transform(), va="top", fontsize=8
        )
    axis.set(xlabel="time [s]", ylabel="servo torque [N·m]", xlim=(0.0, end))
    axis.set_title(title, fontsize=10)
    axis.set_ylim(0.0, 1.15 * max(limit.max(), torque.max()))
    axis.spines[["top", "right"]].set_visible(False)
    handles, labels = axis.get_legend_handles_labels()
    legend = figure.legend(
        handles[::-1], labels[::-1], loc="outside right upper", fontsize=8, frameon=False
    )
    legend.set_title("most loaded")
    legend.get_title().set_fontsize(8)
    figure.savefig(path, dpi=150)
