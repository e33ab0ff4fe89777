"""Page of a replay: the gap between a robot and its twins, as HTML that loads nothing."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.reporting.figure import make_figure, open_frame
from humanoid_getup.reporting.plots import draw_flight, draw_followed
from humanoid_getup.reporting.replay import TWINS, ReplayReport, read_curves, write_gaps
from robots.quaternion import Array

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.figure import Figure

Twins = Mapping[str, ReplayReport]
Panel = tuple[str, Mapping[str, Array]]
PLOTTED = 6  # joints, those that differ most
MEASURED, TARGET = "measured", "target"
COLORS = {TARGET: "0.7", MEASURED: "black", TWINS[0]: "#d95f02", TWINS[1]: "#1f78b4"}
COLORED = {name: f'<b style="color:{COLORS[name]}">{name}</b>' for name in TWINS}
SHADES = {0: "0.93", 2: "#e8f4e8"}  # of lying and standing, by their places in `PHASES`
WIDTH, PANEL, SHARPNESS = 10.4, 1.5, 130  # inches, inches, dots per inch
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1080px; margin: 2em auto; padding: 0 1em }
h2 { font-size: 1.15em; margin: 2em 0 .4em; border-bottom: 1px solid #ddd }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { padding: .12em .5em; text-align: right; white-space: nowrap }
th[colspan] { text-align: center }
th:first-child, td:first-child { text-align: left; padding-left: 0 }
.text td { text-align: left; white-space: normal }
th, .text td:first-child, small { color: #666; font-weight: normal }
img { width: 100% }
"""
CAPTION = (
    "RMS of measured minus replayed joint angles, the joint that differs most, the torso's tilt. "
    "Lying (gray in the plots): until torque comes on; standing (green): longest time upright."
)


def write_page(record: FlightRecord, twins: Twins, facts: Mapping[str, str]) -> str:
    """Write the page of a flight log of at least one cycle and of its replays.

    Args:
        record: Flight log.
        twins: Replays by the names of their twins, that of the robot as described first.
        facts: What else is known of the flight, by name.
    """
    title = escape(f"{record.robot}, {record.path.name}: robot and twin")
    found = (f"{COLORED[name]}: {escape(twin.headline)}." for name, twin in twins.items())
    events = [(f"{one.time - record.time[0]:.2f} s", one.kind, one.text) for one in record.events]
    parts = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>',
        f"<style>{STYLE}</style><h1>{title}</h1><p>{'<br>'.join(found)}</p>",
        _make_table(facts.items(), 'class="text"'),
        f"<h2>Gap in each phase</h2><p><small>{CAPTION}</small></p>",
        _make_table(write_gaps(twins)),
        "<h2>Gap of each joint</h2>",
        *_make_heat_table(twins),
        "<h2>Joints that differ most</h2>",
        _draw(twins, list(_list_joints(record, twins))),
        "<h2>Torso, current and supply</h2>",
        _draw(twins, list(_list_curves(record, twins))),
        "<h2>Flight as logged</h2>",
        _make_table(events, 'class="text"'),
        _embed(draw_flight(record)),
        *(["<h2>Style</h2>", _embed(style)] if (style := draw_followed(record)) else []),
    ]
    return "\n".join(parts)


def _make_table(rows: Iterable[Sequence[str]], attribute: str = "") -> str:
    return f"<table {attribute}>{''.join(map(_make_row, rows))}</table>"


def _make_row(cells: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<td>{COLORED.get(cell) or escape(cell)}</td>' for cell in cells)}</tr>"


def _make_heat_table(twins: Twins) -> Iterator[str]:
    """Make a row for each joint, the worst first, and for the tilt."""
    first = next(iter(twins.values()))
    spans, names = list(first.gaps), (*first.joint_names, "tilt")
    yield f"<p><small>RMS [mrad], full color from {1e3 * first.threshold:g} mrad.</small></p>"
    headings = (f'<th colspan="{len(twins)}">{span}</th>' for span in spans)
    yield f"<table><tr><th></th>{''.join(headings)}</tr>"
    yield _make_row(["", *list(twins) * len(spans)])
    for k in (*np.argsort(-first.rms, kind="stable"), first.rms.size):
        gaps = (float(twin.gaps[span][k]) for span in spans for twin in twins.values())
        yield f"<tr><td>{escape(names[k])}</td>"
        for gap in gaps:
            share = 0.75 * min(1.0, np.sqrt(gap / first.threshold))  # the root shows small ones
            yield f'<td style="background:rgb(214 60 40/{share:.2f})">{1e3 * gap:.1f}</td>'
        yield "</tr>"
    yield "</table>"


def _list_joints(record: FlightRecord, twins: Twins) -> Iterator[list[Panel]]:
    """Yield angles and differences of the joints that differ most."""
    first = next(iter(twins.values()))
    for joint in np.argsort(-first.rms, kind="stable")[:PLOTTED]:
        measured = np.degrees(record.state["joint_pos"][:, joint])
        apart = {name: np.degrees(twin.difference[:, joint]) for name, twin in twins.items()}
        replayed = {name: measured - difference for name, difference in apart.items()}
        is_held = record.sent["torque_limit"][:, joint] > 0.0
        target = np.where(is_held, np.degrees(record.sent["joint_pos"][:, joint]), np.nan)
        angles = {TARGET: target, MEASURED: measured} | replayed
        yield [(f"{first.joint_names[joint]} [°]", angles), ("difference [°]", apart)]


def _list_curves(record: FlightRecord, twins: Twins) -> Iterator[list[Panel]]:
    """Yield tilt, current and supply, as far as they were measured."""
    for label, measured in read_curves(record.state.columns).items():
        if label.startswith("tilt") or np.nan_to_num(measured).any():
            replayed = {name: twin.curves[label] for name, twin in twins.items()}
            yield [(label, {MEASURED: measured} | replayed)]


def _draw(twins: Twins, rows: Sequence[Sequence[Panel]]) -> str:
    """Plot rows of panels over time and phases."""
    report = next(iter(twins.values()))
    time = report.time
    figure = make_figure(WIDTH, PANEL * len(rows) + 0.5)
    axes = figure.subplots(len(rows), len(rows[0]), sharex=True, squeeze=False)
    for axis, (label, curves) in zip(
        axes.flat, (each for row in rows for each in row), strict=True
    ):
        for phase, color in SHADES.items():
            within = time[report.phase == phase]
            if len(within):
                axis.axvspan(within[0], within[-1], color=color, linewidth=0)
        for name, curve in curves.items():
            axis.plot(
                time, curve, color=COLORS[name], linewidth=1.1 + (name == MEASURED), label=name
            )
        axis.set_ylabel(label, fontsize=8)
        axis.tick_params(labelsize=8)
        axis.set_xlim(0.0, max(float(time[-1]), 1e-3))
        open_frame(axis)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4, fontsize=9, frameon=False)
    return _embed(figure)


def _embed(figure: Figure) -> str:
    data = BytesIO()
    figure.savefig(data, dpi=SHARPNESS, format="png")
    return f'<img alt="" src="data:image/png;base64,{b64encode(data.getvalue()).decode()}">'
