"""The page of the benchmark over bodies, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

from humanoid_getup.benchmarks.bodies.body_bench import FALLS, STARTS, BodyBench, BodyCase
from humanoid_getup.benchmarks.bodies.body_rise import BodySummary
from humanoid_getup.benchmarks.bodies.published_body import (
    COMMIT,
    EPISODES,
    PAPER,
    REPOSITORY,
)
from humanoid_getup.experiments.starts.falls import CLASSES, UNCLASSED
from humanoid_getup.reporting.benchmark_page import list_servos, name_programs
from humanoid_getup.reporting.page_cells import (
    NONE,
    write_count,
    write_number,
    write_rate,
    write_spread,
    write_table,
)

DEFINITIONS = (
    "**Stood**: for 3.0 s without a break, torso tilt at most 15°, neck at least 90 % of its "
    "standing height, nothing but the feet touching the ground; judged by ground truth. Intervals "
    "are 95 % (Wilson).",
    "**Head up**: the head is within 20 % of its standing height above the middle of the feet, the "
    "measure of the makers; **at 5 s** after the first movement, as they count it, and **at the "
    "end** of the rise, however late. A rise that was aborted is not up at the end. Time for "
    "planning does not count.",
    "**Falls**: random joint angles, dropped limp in any orientation, settled, classed by gravity "
    "in the torso.",
    "**Their starts**: states drawn from the makers' file, upright ones included, with joint "
    "angles clipped to the ranges, settled on the robot's own shapes with joints held; the rise "
    "begins from there. **Other** ones lie on no side.",
    "**plan** plans, filters and preflights each rise from stored motions; other methods are "
    "policies of these names.",
    "**Bodies** are imported from the makers' models as they are: shapes become boxes and "
    "capsules, and every joint has the servo type nearest to its limits, at stall torque.",
)
THEIRS = (
    f"{PAPER}; {REPOSITORY}, commit {COMMIT}, analysis/special.csv and analysis/loo.csv. Share of "
    f"{EPISODES} episodes whose head was up as they ended: at 5 s, or when the robot was upside "
    "down (135°) or pitched faster than 7.5 rad/s. Their simulation has the makers' own shapes and "
    "position actuators, without a servo's speed limit; five joints a side move alike at 20 Hz. "
    "Specialists were trained on the body, the others on the six other bodies; ten training seeds "
    "each, median (lowest to highest)."
)


def write_bodies_page(result: BodyBench) -> str:
    """Write the page of a result of `getup bench bodies`."""
    blocks = [
        f"# Bodies of others: getting up, n = {result.n} falls of each class",
        *(f"**Note.** {note}" for note in result.notes),
        *_write_cases(result, STARTS, f"From {result.n_starts} of their start states"),
        *_write_cases(result, FALLS, "From falls of all classes"),
        "## What their makers report",
        THEIRS,
        _write_published(result),
        "## Bodies and conditions",
        _write_bodies(result),
        f"Seed {result.seed}; plans search for {result.search_budget_s:g} s of simulated time; "
        f"{name_programs(next(iter(result.conditions.values())))}. Repeat it with:",
        f"```\n{result.command}\n```",
        "## Definitions",
        "\n".join(f"- {text}" for text in DEFINITIONS),
    ]
    return "\n\n".join(blocks) + "\n"


def _write_cases(result: BodyBench, kind: str, title: str) -> Iterator[str]:
    """Write both measures of all bodies from one kind of starts, then those of each class."""
    cases = [case for case in result.cases.values() if case.starts == kind]
    found = {name for case in cases for name in case.classes}
    classes = [name for name in (*CLASSES, UNCLASSED) if name in found]
    overall = ("head up at 5 s", "head up at the end", "stood", "to stand [s]", "RMS [N·m]")
    yield f"## {title}"
    yield write_table(
        ("body", "method", *overall),
        (
            (
                *(case.body, case.method, *_write_heads(case), write_rate(case)),
                *(write_spread(case.stand_time_s), write_spread(case.rms_torque_nm)),
            )
            for case in cases
        ),
    )
    yield "Stood, by class:"
    yield write_table(("body", "method", *classes), _list_classes(cases, classes, end=False))
    yield "Head up at the end, by class:"
    yield write_table(("body", "method", *classes), _list_classes(cases, classes, end=True))
    if rows := [(case.body, case.method, text) for case in cases for text in case.failures]:
        yield "Held no stand, by number of the start:"
        yield write_table(("body", "method", "start, and why"), rows)


def _list_classes(
    cases: Sequence[BodyCase], classes: Sequence[str], *, end: bool
) -> Iterator[tuple[str, ...]]:
    for case in cases:
        found = [case.classes.get(name) for name in classes]
        cells = [_write_heads(one)[1] if one and end else write_rate(one) for one in found]
        yield case.body, case.method, *cells


def _write_heads(case: BodySummary) -> tuple[str, str]:
    """Write how many heads were up at the time limit, and at the end."""
    return (
        write_count(case.head_in_time, case.n, case.head_in_time_interval_95),
        write_count(case.head_at_end, case.n, case.head_at_end_interval_95),
    )


def _write_published(result: BodyBench) -> str:
    return write_table(
        ("body", "specialists", "trained on the six others"),
        ((b.name, _spread(b.specialists), _spread(b.unseen)) for b in result.published),
    )


def _spread(shares: Sequence[float]) -> str:
    if not shares:
        return NONE
    return (
        f"{write_number(median(shares))} ({write_number(min(shares))} to "
        f"{write_number(max(shares))})"
    )


def _write_bodies(result: BodyBench) -> str:
    columns = ("joints", "mass [kg]", "neck [m]", "head [m]", "servos", "stall [N·m]", "supply [V]")
    rows = []
    for body in result.published:
        about = result.conditions[body.name]
        rows.append(
            (
                *(body.name, about.joints, write_number(about.mass_kg)),
                *(write_number(about.neck_height_m), write_number(body.head_height)),
                *(list_servos(about), write_number(about.stall_torque_nm), f"{about.supply_v:g}"),
            )
        )
    return write_table(("body", *columns), rows)
