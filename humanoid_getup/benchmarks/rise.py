"""Rises from many falls by one strategy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from drivers import Twin
from humanoid_getup.engines.versions import Versions
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.rise import Rise, RiseFigures
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import Fall
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.strategies.plan import Strategy
from robots.servo import LimitMode

BENCH_CLASSES = ("supine", "prone", "lateral")
"""Start classes of benchmarks; left and right count as one."""


@dataclass(frozen=True, kw_only=True)
class RisePiece:
    """One of many rises, which depends on nothing but this and its strategy."""

    number: int
    fall: Fall
    bench_class: str
    seed: int
    """Of all rises; each has its own generator by its number."""
    preflight: bool = True
    """Whether the preflight may refuse it."""


@dataclass(frozen=True, kw_only=True)
class MeasuredRise(RiseFigures):
    """Figures of one rise; unset fields are not needed to identify it."""

    bench_class: str | UnsetType = UNSET
    """Class of the fall."""


class RiseBench(msgspec.Struct, frozen=True, kw_only=True):
    """Many rises by plans, by start class, with their conditions."""

    name: str = "rise"
    seed: int
    n: int
    robot: str
    body: str
    load: str | None
    scene: str
    torque_limit_nm: float | None
    """None for stall torque."""
    limit_by: LimitMode | None
    versions: Versions
    planning: bool
    filtering: bool
    prefer: str
    search_budget_s: float
    classes: dict[str, RiseSummary]
    all: RiseSummary
    rises: list[MeasuredRise]


def list_pieces(
    falls: Sequence[Fall],
    seed: int,
    *,
    classes: Sequence[str] = BENCH_CLASSES,
    preflight: bool = True,
) -> dict[str, RisePiece]:
    """List a rise from every fall; the falls are in the order of the classes, as many of each."""
    return {
        str(number): RisePiece(
            number=number,
            fall=fall,
            bench_class=classes[number * len(classes) // len(falls)],
            seed=seed,
            preflight=preflight,
        )
        for number, fall in enumerate(falls)
    }


def measure_rise(strategy: Strategy, piece: RisePiece) -> MeasuredRise:
    """Rise on a fresh twin."""
    rise = rise_from(strategy, piece)
    return MeasuredRise(**vars(rise.figures()), bench_class=piece.bench_class)


def rise_from(strategy: Strategy, piece: RisePiece) -> Rise:
    """Rise from one of many falls on a fresh twin."""
    options = SessionOptions(start_class=piece.fall.start_class, preflight=piece.preflight)
    twin = Twin(strategy.world, piece.fall.posture)
    return rise_once(twin, strategy, [piece.seed, 1, piece.number], options)


def rise_once(twin: Twin, strategy: Strategy, seed: list[int], options: SessionOptions) -> Rise:
    """Try once to rise on a twin."""
    rng = np.random.default_rng(seed)
    return get_up(twin, strategy, seed=rng, max_attempts=1, options=options)


def summarize_classes(
    rises: Sequence[MeasuredRise], classes: Sequence[str]
) -> dict[str, RiseSummary]:
    """Summarize the rises of each class."""
    return {
        name: RiseSummary.of([rise for rise in rises if rise.bench_class == name])
        for name in classes
    }
