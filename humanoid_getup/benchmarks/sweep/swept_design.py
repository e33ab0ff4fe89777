"""Rises of designs: of one class, and over all."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Self

import msgspec
import numpy as np

from humanoid_getup.benchmarks.bench_result import CaseBench, KeptRise
from humanoid_getup.benchmarks.rise import list_pieces, measure_rise
from humanoid_getup.benchmarks.sweep.design import Design
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.experiments.starts.drop import FallError
from humanoid_getup.experiments.starts.falls import CLASSES, sample_falls
from humanoid_getup.strategies.plan import Strategy
from robots import Body

HALF = 0.5
"""Share of rises that stand, below which a design does not get up."""
Coordinate = str | float | None


class SweptClass(msgspec.Struct, frozen=True, kw_only=True):
    """The rises of a design from one class of falls."""

    rises: list[KeptRise]
    missing: str = ""
    """Why it does not come to lie so; "" if it does."""


class SweptDesign(RiseSummary, frozen=True, kw_only=True):
    """The rises of a design over all classes."""

    body: str
    servo: str
    torque_limit_nm: float | None
    scene: str
    way: str
    classes: dict[str, RiseSummary]
    missing: dict[str, str]
    """Classes in which it does not come to lie, and why."""

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Return its place in the sweep, by the name of each axis."""
        factors = dict(Body.parse(self.body))
        others = {"torque limit [N·m]": self.torque_limit_nm, "servo": self.servo}
        return factors | others | {"scene": self.scene, "way": self.way}

    @property
    def share(self) -> float:
        """Return the share of its rises that stood; nan without any."""
        return self.stood / self.n if self.n else math.nan

    @classmethod
    def join(cls, design: Design, found: Mapping[str, SweptClass]) -> Self:
        """Join the rises of all classes."""
        return cls.of(
            [rise for one in found.values() for rise in one.rises],
            body=design.body,
            servo=design.servo,
            torque_limit_nm=design.torque_limit,
            scene=design.scene,
            way=design.way,
            classes={name: RiseSummary.of(one.rises) for name, one in found.items() if one.rises},
            missing={name: one.missing for name, one in found.items() if one.missing},
        )


class Sweep(CaseBench[SweptDesign], frozen=True, kw_only=True):
    """The results of a sweep."""

    search_budget_s: float
    axes: dict[str, list[str | float | None]]
    """Values of what was varied: parts of the body, torque limit, servo, scene, way."""
    command: str
    """Command line that repeats it."""


def measure_class(
    strategy: Strategy, side: LyingSide, seed: int, each: int, *, preflight: bool
) -> SweptClass:
    """Rise from ``each`` settled falls of a class, drawn from the seed alone."""
    rng = np.random.default_rng([seed, CLASSES.index(side)])
    try:
        falls = sample_falls(strategy.world, {side: each}, rng)
    except FallError as error:
        return SweptClass(rises=[], missing=str(error))
    pieces = list_pieces(falls, seed, classes=(side,), preflight=preflight)
    rises = [measure_rise(strategy, piece) for piece in pieces.values()]
    return SweptClass(rises=msgspec.convert(rises, list[KeptRise], from_attributes=True))


def list_axes(cases: Iterable[SweptDesign]) -> dict[str, list[Coordinate]]:
    """List what differs between designs: the values of each coordinate, in order."""
    places = [one.coordinates for one in cases]
    found = {name: [*dict.fromkeys(place[name] for place in places)] for name in places[0]}
    return {name: values for name, values in found.items() if len(values) > 1}


def find_ends(cases: Sequence[SweptDesign], axis: str) -> list[tuple[float, float]]:
    """Find between which values of a numeric axis half of the rises stand no more, or again."""
    along = sorted((float(one.coordinates[axis] or 0.0), one.share) for one in cases)
    return [
        (low, high)
        for (low, first), (high, second) in pairwise(along)
        if (first >= HALF) != (second >= HALF)
    ]


def group_cases(
    cases: Iterable[SweptDesign], axes: Sequence[str]
) -> dict[tuple[Coordinate, ...], list[SweptDesign]]:
    """Group designs by their places on some axes."""
    found = dict[tuple[Coordinate, ...], list[SweptDesign]]()
    for one in cases:
        found.setdefault(tuple(one.coordinates[axis] for axis in axes), []).append(one)
    return found


def list_numeric(axes: Mapping[str, Sequence[Coordinate]]) -> list[str]:
    """List axes of numbers, those with the most values first."""
    numeric = [name for name, some in axes.items() if all(isinstance(x, float) for x in some)]
    return sorted(numeric, key=lambda name: -len(axes[name]))
