"""The page of a sweep, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator

from humanoid_getup.benchmarks.sweep.swept_design import (
    HALF,
    Sweep,
    find_ends,
    group_cases,
    list_numeric,
)
from humanoid_getup.experiments.starts.falls import CLASSES
from humanoid_getup.reporting.page_cells import NONE, write_rate, write_spread, write_table
from humanoid_getup.reporting.sweep_plot import name_place

STOOD = (
    "**Stood**: for 3.0 s without a break, torso tilt at most 15°, neck at least 90 % of its "
    "standing height, nothing but the feet touching the ground; intervals are 95 % (Wilson)."
)


def write_sweep_page(result: Sweep) -> str:
    """Write the page of a result of `getup sweep`."""
    blocks = [
        f"# {result.robot}: {len(result.cases)} designs, n = {result.n} falls of each class",
        "![Share of rises that stood](sweep.png)",
        *_write_ends(result),
        "## Designs",
        _write_designs(result),
        *_write_missing(result),
        STOOD,
        f"Seed {result.seed}; plans search for {result.search_budget_s:g} s of simulated time. "
        "Falls of all designs are drawn from this seed, and settle on each body in its own way. "
        "Repeat it with:",
        f"```\n{result.command}\n```",
    ]
    return "\n\n".join(blocks) + "\n"


def _write_ends(result: Sweep) -> Iterator[str]:
    """Write where along each numeric axis half of the rises stand no more."""
    rows = list[tuple[str, str, str]]()
    for axis in list_numeric(result.axes):
        others = [name for name in result.axes if name != axis]
        for place, some in group_cases(result.cases.values(), others).items():
            ends = ", ".join(f"{low:g} to {high:g}" for low, high in find_ends(some, axis))
            is_above = all(one.share >= HALF for one in some if one.n)
            level = "at least half stand" if is_above else "fewer than half stand"
            rows.append((axis, name_place(place, others) or NONE, ends or level))
    if rows:
        yield "## Where it stops getting up"
        yield f"Between these values the share of rises that stand passes {HALF:.0%}."
        yield write_table(("along", "at", "between"), rows)


def _write_designs(result: Sweep) -> str:
    headings = ("design", "stood", *CLASSES, "stand [s]", "peak [N·m]")
    return write_table(
        headings,
        (
            (
                name,
                write_rate(one),
                *(
                    f"{one.classes[side].stood} of {one.classes[side].n}"
                    if side in one.classes
                    else NONE
                    for side in CLASSES
                ),
                write_spread(one.stand_time_s),
                write_spread(one.peak_torque_nm),
            )
            for name, one in result.cases.items()
        ),
    )


def _write_missing(result: Sweep) -> Iterator[str]:
    """Write in which classes designs do not come to lie."""
    found = {name: one.missing for name, one in result.cases.items() if one.missing}
    if found:
        yield "## Not measured"
        yield "\n".join(
            f"- {name}, {side}: {why}" for name, some in found.items() for side, why in some.items()
        )
