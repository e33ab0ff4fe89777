"""The page of a whole benchmark, in Markdown: results first, then how to repeat them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from humanoid_getup.benchmarks.whole import CapSummary, WholeBench
from humanoid_getup.experiments.judging.summary import Quantiles, RiseSummary
from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes

NONE = "–"
DEFINITIONS = (
    "**Stood**: for 3.0 s without a break, torso tilt at most 15°, neck at least 90 % of its "
    "standing height, nothing but the feet touching the ground; judged by ground truth. Intervals "
    "are 95 % (Wilson).",
    "**Falls**: random joint angles, dropped limp in any orientation, settled, classed by gravity "
    "in the torso. Every method gets the same falls.",
    "**plan** plans, filters and preflights each rise; **nearest** plays the stored motion nearest "
    "to the fall, as it is; the other methods are policies of these names.",
    "**Torque caps** are shares of the strongest servo's stall torque, and limit every servo. "
    "**Of limit** is the largest driving torque of any servo over its limit.",
    "**Head** is the speed at which the head hits the ground; 0 if it does not. Times and torques "
    "are medians (95th percentiles); time to stand is that of the rises that stood.",
)
Cases = Sequence[CapSummary]
SPREAD = 0.08  # of the distance between two caps, between methods that would hide each other


def write_page(result: WholeBench) -> str:
    """Write the page of a result of `getup bench all`."""
    blocks = [
        f"# {result.robot}: getting up, n = {result.n} falls of each class",
        *_write_notes(result),
        *_write_results(result),
        *_write_pictures(result),
        "## Conditions",
        _write_table(("condition", "value"), _list_conditions(result)),
        "Repeat it, falls and all, with:",
        f"```\n{result.command}\n```",
        "## Definitions",
        "\n".join(f"- {text}" for text in DEFINITIONS),
    ]
    return "\n\n".join(blocks) + "\n"


def _write_notes(result: WholeBench) -> list[str]:
    missing = [f"No fall ends {name}: {reason}." for name, reason in result.missing_classes.items()]
    return [f"**Not measured.** {note}" for note in (*result.notes, *missing)]


def _write_results(result: WholeBench) -> list[str]:
    cases = result.cases.values()
    if not cases:
        return []
    columns = ("to stand [s]", "peak [N·m]", "of limit", "RMS [N·m]", "head [m/s]")
    keys = ("stand_time_s", "peak_torque_nm", "torque_use", "rms_torque_nm", "head_impact_m_s")
    classes = list(dict.fromkeys(name for case in cases for name in case.classes))
    overall = [
        (
            case.method,
            _name_cap(case),
            _write_rate(case),
            *(_write_spread(getattr(case, key)) for key in keys),
        )
        for case in cases
    ]
    by_class = [
        (case.method, case.cap, *(_write_rate(case.classes.get(name)) for name in classes))
        for case in cases
    ]
    times = [
        (
            case.method,
            case.cap,
            *(
                _write_spread(case.classes[name].stand_time_s) if name in case.classes else NONE
                for name in classes
            ),
        )
        for case in cases
    ]
    return [
        "## Results",
        _write_table(("method", "torque cap", "stood", *columns), overall),
        "### Stood, by class",
        _write_table(("method", "torque cap", *classes), by_class),
        "### Time to stand [s], by class",
        _write_table(("method", "torque cap", *classes), times),
    ]


def _write_pictures(result: WholeBench) -> list[str]:
    pictures = result.pictures
    if not result.cases:
        return []
    blocks = ["## Pictures"]
    if pictures.plot:
        blocks.append(f"![Stands and times over the torque caps]({pictures.plot})")
    blocks += [
        f"![A {name} fall, {pictures.method}, stall torque]({file})"
        for name, file in pictures.strips.items()
    ]
    if pictures.reason:
        blocks.append(f"No film strips: {pictures.reason}.")
    return blocks


def _list_conditions(result: WholeBench) -> list[tuple[str, str]]:
    about = result.conditions
    servos = ", ".join(f"{count} × {name}" for name, count in about.servos.items())
    programs = f"humanoid-getup {about.humanoid_getup}, MuJoCo {about.mujoco}"
    return [
        ("robot", f"{result.robot}, {about.body or 'original'} body"),
        ("mass", f"{about.mass_kg:.2f} kg"),
        ("standing neck height", f"{about.neck_height_m:.3f} m"),
        ("servos", f"{servos}; {about.joints} joints"),
        ("stall torque of the strongest", f"{about.stall_torque_nm:.2f} N·m"),
        ("supply", f"{about.supply_v:g} V"),
        ("torque caps act on", about.limit_by),
        ("control period", f"{1000.0 * about.control_period_s:g} ms"),
        ("ground", about.scene),
        ("seed", str(result.seed)),
        ("falls of each class", str(result.n)),
        ("programs", f"{programs}, Python {about.python}"),
    ]


def _name_cap(case: CapSummary) -> str:
    limit = case.torque_limit_nm
    return case.cap if limit is None else f"{case.cap}, {limit:g} N·m"


def _write_rate(case: RiseSummary | None) -> str:
    """Write how many rises stood, with the interval; a dash for none."""
    if case is None:
        return NONE
    low, high = case.stood_interval_95
    return f"{case.stood} of {case.n} ({low:.0%} to {high:.0%})"


def _write_spread(value: Quantiles) -> str:
    """Write a median, with the 95th percentile."""
    if value.median is None:
        return NONE
    return f"{_write_number(value.median)} ({_write_number(value.p95)})"


def _write_number(value: float | None) -> str:
    """Write a number with two decimals; a dash for none."""
    return NONE if value is None or math.isnan(value) else f"{value:.2f}"


def _write_table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Write a Markdown table; vertical bars in cells are escaped."""
    lines = [tuple(headings), ("---",) * len(headings), *rows]
    cells = [[str(cell).replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


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
