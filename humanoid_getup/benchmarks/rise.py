"""Rises from many falls by one strategy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from drivers import Twin
from humanoid_getup.benchmarks.bench_result import (
    KeptRise,
    MeasuredRise,
    RiseBench,
)
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.experiments.starts.falls import Fall, sample_falls
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise

BENCH_CLASSES = ("supine", "prone", "lateral")
"""Start classes of benchmarks; left and right count as one."""

Report = Callable[[MeasuredRise], None]
"""Called after each rise, with its figures."""


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


DoRises: TypeAlias = Callable[[Mapping[str, RisePiece]], Mapping[str, MeasuredRise]]


def bench_rise(
    strategy: PlannedRise,
    *,
    seed: int,
    each: int = 20,
    report: Report = lambda _: None,
    do: DoRises | None = None,
) -> RiseBench:
    """Rise by plans from ``each`` settled falls of every class on the twin.

    Args:
        strategy: Plans the rises.
        seed: Seed of the falls and the plans.
        each: Falls of each class.
        report: Called after each rise that is done here.
        do: Does the rises elsewhere; None: one after another, here.
    """
    falls = _sample(strategy.world, each, seed)
    # An unfiltered path is played to see whether it stands.
    pieces = list_pieces(falls, seed, preflight=strategy.options.filtering)
    rises = [*do(pieces).values()] if do else rise_all(strategy, pieces, report)
    return RiseBench(
        name="rise",
        seed=seed,
        n=len(rises),
        robot=strategy.world.robot.name,
        scene=strategy.world.scene.name,
        torque_limit_nm=strategy.torque_limit.value,
        limit_by=strategy.torque_limit.by,
        planning=strategy.options.planning,
        filtering=strategy.options.filtering,
        assistance=strategy.options.assistance,
        prefer=strategy.prefer,
        search_budget_s=strategy.search_budget,
        classes=summarize_classes(rises, BENCH_CLASSES),
        all=RiseSummary.of(rises),
        rises=rises,
    )


def summarize_classes(rises: Sequence[KeptRise], classes: Sequence[str]) -> dict[str, RiseSummary]:
    """Summarize the rises of each class."""
    return {
        name: RiseSummary.of([rise for rise in rises if rise.bench_class == name])
        for name in classes
    }


def _sample(world: World, each: int, seed: int) -> list[Fall]:
    rng = np.random.default_rng(seed)
    return sample_falls(world, dict.fromkeys(BENCH_CLASSES, each), rng)


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


def rise_all(
    strategy: Strategy, pieces: Mapping[str, RisePiece], report: Report
) -> list[MeasuredRise]:
    """Do rises one after another."""
    rises = list[MeasuredRise]()
    for piece in pieces.values():
        rises.append(measure_rise(strategy, piece))
        report(rises[-1])
    return rises


def measure_rise(strategy: Strategy, piece: RisePiece) -> MeasuredRise:
    """Rise on a fresh twin."""
    rise = rise_from(strategy, piece.fall, piece.number, piece.seed, preflight=piece.preflight)
    return MeasuredRise(**vars(rise.figures()), bench_class=piece.bench_class)


def rise_from(
    strategy: Strategy, fall: Fall, number: int, seed: int, *, preflight: bool = True
) -> RiseResult:
    """Rise from one of many falls, by its number, on a fresh twin."""
    return rise_once(
        Twin(strategy.world, fall.posture),
        strategy,
        [seed, 1, number],
        SessionOptions(start_class=fall.start_class, preflight=preflight),
    )


def rise_once(
    twin: Twin, strategy: Strategy, seed: list[int], options: SessionOptions
) -> RiseResult:
    """Try once to rise on a twin."""
    rng = np.random.default_rng(seed)
    return get_up(twin, strategy, seed=rng, max_attempts=1, options=options)
