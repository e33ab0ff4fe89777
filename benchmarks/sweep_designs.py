"""Get up with every combination of body, servos, torque limit, scene and way; say where it stops.

    python benchmarks/sweep_designs.py --body legs=0.8:1.4:0.1 --torque-limit 1.5:4.0:0.5 \
        --ledger legs.jsonl --json legs.json --picture legs.png

`FROM:TO:STEP` has both ends. The falls of all designs are drawn from one seed, and settle on each
body in its own way. With a ledger, an interrupted sweep continues, also with wider ranges.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import tyro
from msgspec.structs import asdict
from other_servos import use_servos
from script import LOAD_FIGURES, WorkOptions, do_pieces, print_table, write_results

from humanoid_getup.benchmarks.rise import MeasuredRise, list_pieces, measure_rise
from humanoid_getup.engines.versions import Versions
from humanoid_getup.experiments.drop import FallError
from humanoid_getup.experiments.falls import CLASSES, sample_falls
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST, STRAIGHT, make_strategy
from humanoid_getup.strategies.plan import Strategy
from robots import Body, Robot, TorqueLimit, load_robot
from robots.servo import LimitMode

HALF = 0.5  # share of rises that stand, below which a design does not get up
MOST_PANELS, MOST_LINES = 6, 8
FIGURES = ("n", "stood", "stood_interval_95", *LOAD_FIGURES)
Place = tuple[str | float | None, ...]
"""Values of a design on some axes."""


@dataclass(frozen=True, kw_only=True)
class SweepOptions(WorkOptions):
    """Options of this script."""

    robot: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""
    body: str = ""
    """Factors on the lengths of shoulders, arms, torso or legs, such as arms=1.0:1.6:0.1,legs=1.1.
    Masses and inertias follow."""
    servos: tuple[str, ...] = ("",)
    """Types of which all servos are; default: the robot's own."""
    torque_limit: str = ""
    """Torque limits of every servo [N·m], such as 1.5:4.0:0.5; default: stall torque."""
    limit_by: LimitMode | None = None
    """What the limits act on; default: the servos' own way."""
    scenes: tuple[str, ...] = ("flat",)
    """Names or files of scenes."""
    ways: tuple[str, ...] = ("plan",)
    """plan, nearest, straight, and policies by name or file."""
    search_budget: float = DEFAULTS.search_budget
    """Simulated time in which the search of a plan may vary it [s]."""
    n: int = 5
    """Falls of each class: supine, prone, left, right."""
    ledger: Path | None = None
    """File that keeps what is finished."""
    picture: Path | None = None
    """PNG file: a map over two ranges, lines over one."""


@dataclass(frozen=True, kw_only=True)
class Design:
    """One design, and where and how it gets up; "" for what is the robot's own."""

    body: str
    servo: str
    torque_limit: float | None
    """[N·m]; None for stall torque."""
    scene: str
    way: str

    def __str__(self) -> str:
        limit = "" if self.torque_limit is None else f"{self.torque_limit!r} N·m"
        return ", ".join(filter(None, (self.body, self.servo, limit, self.scene, self.way)))

    @property
    def coordinates(self) -> dict[str, str | float | None]:
        """Return its place in the sweep, by the name of each axis."""
        others = {"torque limit [N·m]": self.torque_limit, "servo": self.servo}
        return dict(Body.parse(self.body)) | others | {"scene": self.scene, "way": self.way}

    def build_robot(self, robot: str) -> Robot:
        """Build the robot of this design."""
        built = load_robot(robot, Body.parse(self.body))
        return use_servos(built, self.servo) if self.servo else built


@dataclass(frozen=True)
class Piece:
    """The rises of a design from one side."""

    design: Design
    side: LyingSide

    def __str__(self) -> str:
        return f"{self.design}: {self.side}"


@dataclass(frozen=True, kw_only=True)
class SideRises:
    """The rises of a design from one side."""

    rises: list[MeasuredRise]
    missing: str = ""
    """Why the robot does not come to lie so; "" if it does."""


def main(options: SweepOptions) -> None:
    """Sweep, print where the robot stops getting up, and write figures and picture."""
    designs = list_designs(options)
    for design in designs:  # what cannot be had is refused before any rise
        robot = design.build_robot(options.robot)
        TorqueLimit(design.torque_limit, options.limit_by).on(robot)
        load_scene(design.scene, robot, options.seed)
    pieces = [Piece(design, side) for design in designs for side in CLASSES]
    ledger = open_ledger(options) if options.ledger else None
    work = partial(rise_from_side, options)
    found = do_pieces(work, pieces, options, ledger=ledger, kind=SideRises)
    by_side = dict(zip(pieces, found, strict=True))
    cases = {
        design: summarize_design({side: by_side[Piece(design, side)] for side in CLASSES})
        for design in designs
    }
    axes = list_axes(designs)
    result: dict[str, Any] = {
        "name": "sweep",
        "seed": options.seed,
        "n": options.n,
        "robot": load_robot(options.robot).name,
        "limit_by": options.limit_by,
        "search_budget_s": options.search_budget,
        "axes": axes,
        "cases": {str(design): vars(design) | case for design, case in cases.items()},
    }
    write_results(result, FIGURES, options.json)
    shares = {design: case["stood"] / (case["n"] or math.nan) for design, case in cases.items()}
    if ends := [*describe_ends(axes, shares)]:
        print_table(("along", "at", "half stand between"), ends)
    if options.picture:
        draw(axes, cases, options.picture)


def open_ledger(options: SweepOptions) -> Ledger:
    """Open the ledger of finished pieces, or begin one."""
    assert options.ledger is not None
    recipe = {
        "versions": Versions.find(options.robot),
        "seed": options.seed,
        "n": options.n,
        "search_budget": options.search_budget,
        "limit_by": options.limit_by,
    }
    return Ledger.resume(options.ledger, recipe)


def list_designs(options: SweepOptions) -> list[Design]:
    """List all designs, those of one body together."""
    parts = [item.partition("=") for item in filter(None, options.body.split(","))]
    ranges = [[(part, value) for value in parse_range(text)] for part, _, text in parts]
    bodies = [
        ",".join(f"{part}={value!r}" for part, value in choice if value != 1.0)
        for choice in product(*ranges)
    ]
    limits = parse_range(options.torque_limit) if options.torque_limit else [None]
    return [
        Design(body=body, servo=servo, torque_limit=limit, scene=scene, way=way)
        for body, servo, limit, scene, way in product(
            bodies, options.servos, limits, options.scenes, options.ways
        )
    ]


def parse_range(text: str) -> list[float]:
    """Parse a number, or a range FROM:TO:STEP with both ends."""
    try:
        first, last, step = [*map(float, text.split(":")), *[math.nan] * 2][:3]
    except ValueError:
        first = last = step = math.nan
    if ":" not in text and not math.isnan(first):
        return [first]
    if not (step > 0.0 and first <= last):
        raise ValueError(f"range is '{text}', expected a number, or FROM:TO:STEP as 1.0:1.6:0.1")
    return [round(first + k * step, 9) for k in range(math.floor((last - first) / step + 1e-9) + 1)]


def rise_from_side(options: SweepOptions, piece: Piece) -> SideRises:
    """Rise from settled falls of a side, drawn from the seed alone."""
    strategy = make_design_strategy(options, piece.design)
    rng = np.random.default_rng([options.seed, CLASSES.index(piece.side)])
    try:
        falls = sample_falls(strategy.world, {piece.side: options.n}, rng)
    except FallError as error:
        return SideRises(rises=[], missing=str(error))
    preflight = piece.design.way not in (NEAREST, STRAIGHT)
    pieces = list_pieces(falls, options.seed, classes=(piece.side,), preflight=preflight)
    rises = [measure_rise(strategy, each) for each in pieces.values()]
    return SideRises(rises=rises)


@lru_cache(maxsize=1)
def make_design_strategy(options: SweepOptions, design: Design) -> Strategy:
    """Make the strategy of a design; the pieces of one follow each other."""
    robot = design.build_robot(options.robot)
    world = World(robot, load_scene(design.scene, robot, options.seed))
    limit = TorqueLimit(design.torque_limit, options.limit_by).on(robot)
    settings = PlannerSettings(
        torque_limit=limit, search_budget=options.search_budget, threads=options.threads
    )
    return make_strategy(world, design.way, settings)


def summarize_design(found: Mapping[LyingSide, SideRises]) -> dict[str, Any]:
    """Summarize the rises of a design over all sides, and of each."""
    everything = asdict(RiseSummary.of([rise for one in found.values() for rise in one.rises]))
    classes = {side: RiseSummary.of(one.rises) for side, one in found.items() if one.rises}
    missing = {side: one.missing for side, one in found.items() if one.missing}
    return everything | {"classes": classes, "missing": missing}


def list_axes(designs: Iterable[Design]) -> dict[str, list[Any]]:
    """List what differs between designs: the values of each coordinate, in order."""
    places = [design.coordinates for design in designs]
    found = {name: [*dict.fromkeys(place[name] for place in places)] for name in places[0]}
    return {name: values for name, values in found.items() if len(values) > 1}


def list_numeric(axes: Mapping[str, Sequence[Any]]) -> list[str]:
    """List axes of numbers, those with the most values first."""
    numeric = [name for name, some in axes.items() if all(isinstance(x, float) for x in some)]
    return sorted(numeric, key=lambda name: -len(axes[name]))


def group(designs: Iterable[Design], axes: Sequence[str]) -> dict[str, list[Design]]:
    """Group designs by their places on some axes."""
    found = dict[str, list[Design]]()
    for design in designs:
        place = [(axis, design.coordinates[axis]) for axis in axes]
        named = (f"{a} {x:g}" if isinstance(x, float) else str(x or "as it is") for a, x in place)
        found.setdefault(", ".join(named), []).append(design)
    return found


def describe_ends(
    axes: Mapping[str, Sequence[Any]], shares: Mapping[Design, float]
) -> Iterator[tuple[str, str, str]]:
    """Describe between which values of each numeric axis half of the rises stand no more."""
    for axis in list_numeric(axes):
        for place, some in group(shares, [name for name in axes if name != axis]).items():
            ends = find_ends([(float(d.coordinates[axis] or 0.0), shares[d]) for d in some])
            is_above = all(shares[design] >= HALF for design in some)
            level = "at least half stand" if is_above else "fewer than half stand"
            yield axis, place, ", ".join(f"{low:g} to {high:g}" for low, high in ends) or level


def find_ends(along: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Find between which values the share that stands passes a half, from (value, share)."""
    return [
        (low, high)
        for (low, first), (high, second) in pairwise(sorted(along))
        if (first >= HALF) != (second >= HALF)
    ]


def draw(
    axes: Mapping[str, Sequence[Any]], cases: Mapping[Design, dict[str, Any]], path: Path
) -> None:
    """Draw the shares that stood: a map over two numeric axes, or lines over one."""
    numeric = list_numeric(axes)
    if not numeric:
        raise SystemExit("no picture: expected a range of lengths or torque limits")
    across, up = numeric[0], numeric[1] if len(numeric) > 1 else None
    groups = group(cases, [axis for axis in axes if axis not in (across, up)])
    if up is None:
        figure, panel = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
        for place, some in [*groups.items()][:MOST_LINES]:
            at = np.array([design.coordinates[across] for design in some], dtype=float)
            share = np.array([cases[d]["stood"] / (cases[d]["n"] or math.nan) for d in some])
            interval = np.array([cases[d]["stood_interval_95"] for d in some])  # (designs, 2)
            panel.errorbar(at, share, np.abs(interval - share[:, None]).T, marker="o", label=place)
        panel.set(xlabel=across, ylabel="stood, 95 % interval", ylim=(-0.04, 1.04))
        if len(groups) > 1:
            panel.legend()
    else:
        groups = dict([*groups.items()][:MOST_PANELS])
        size = (1.0 + 4.2 * len(groups), 3.8)
        figure, panels = plt.subplots(
            1, len(groups), figsize=size, squeeze=False, layout="constrained"
        )
        columns, rows = sorted(axes[across]), sorted(axes[up])
        for panel, (place, some) in zip(panels[0], groups.items(), strict=True):
            share = np.full((len(rows), len(columns)), np.nan)
            for design in some:
                case, at = cases[design], design.coordinates
                k, m = rows.index(at[up]), columns.index(at[across])
                share[k, m] = case["stood"] / (case["n"] or math.nan)
                color = "white" if share[k, m] < HALF else "black"
                panel.text(m, k, f"{case['stood']}/{case['n']}", ha="center", color=color)
            panel.imshow(share, vmin=0.0, vmax=1.0, origin="lower", aspect="auto")
            panel.set_xticks(range(len(columns)), [f"{x:g}" for x in columns])
            panel.set_yticks(range(len(rows)), [f"{y:g}" for y in rows])
            panel.set(xlabel=across, ylabel=up, title=place)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(tyro.cli(SweepOptions, description=__doc__))
