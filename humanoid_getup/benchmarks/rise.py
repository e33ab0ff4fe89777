"""Rises from many falls: one strategy by class, or several strategies on the same falls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from msgspec import UNSET, UnsetType, convert

from drivers import Twin
from humanoid_getup.benchmarks.bench_result import (
    CaseBench,
    KeptRise,
    MeasuredRise,
    MethodSummary,
    RiseBench,
)
from humanoid_getup.benchmarks.pieces import RunPieces, collect, one_by_one
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.judging.summary import RiseSummary, summarize
from humanoid_getup.experiments.starts.falls import Fall, sample_falls
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise

BENCH_CLASSES = ("supine", "prone", "lateral")
"""Start classes of benchmarks; left and right count as one."""
IN_A_ROW = 10  # rises whose heat adds up
REST = 5.0  # s between them, torque off

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
    way: str | UnsetType = UNSET
    """Name of the strategy, if several are compared."""


@dataclass(frozen=True, kw_only=True)
class HeatPiece:
    """Rises in a row by which the servos of one robot heat up, with a rest after each."""

    falls: tuple[Fall, ...]
    seed: int
    way: str


RunRises: TypeAlias = RunPieces[RisePiece, MeasuredRise]
RunMethods: TypeAlias = RunPieces[RisePiece | HeatPiece, MeasuredRise | float]


def bench_rise(
    strategy: PlannedRise,
    *,
    seed: int,
    each: int = 20,
    report: Report = lambda _: None,
    ledger: Ledger | None = None,
    run: RunRises | None = None,
) -> RiseBench:
    """Rise by plans from ``each`` settled falls of every class on the twin.

    Args:
        strategy: Plans the rises.
        seed: Seed of the falls and the plans.
        each: Falls of each class.
        report: Called after each rise.
        ledger: Keeps every rise; those that it holds already are not repeated.
        run: Does the rises by an equal strategy; None: one after another, here.
    """
    falls = _sample(strategy.world, each, seed)
    # An unfiltered path is played to see whether it stands.
    pieces = list_pieces(falls, seed, preflight=strategy.options.filtering)
    rises = rise_all(pieces, run or one_by_one(partial(measure_rise, strategy)), report, ledger)
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


def bench_methods(
    strategies: Mapping[str, Strategy],
    *,
    seed: int,
    each: int,
    heat: bool = True,
    report: Report = lambda _: None,
    run: RunMethods | None = None,
) -> CaseBench[MethodSummary]:
    """Get up from the same settled falls by several strategies, on the twin.

    Args:
        strategies: Strategies to compare, by name, for one world and one torque limit.
        seed: Seed of the falls and the plans.
        each: Falls of each of `BENCH_CLASSES`.
        heat: Whether to measure how hot the servos become in ten rises in a row, too.
        report: Called after each rise.
        run: Does the pieces by equal strategies; None: one after another, here.
    """
    first = next(iter(strategies.values()))
    falls = _sample(first.world, each, seed)
    pieces = {
        f"{name}: {number}": piece
        for name in strategies
        for number, piece in _list_method_pieces(falls, seed, name, heat=heat).items()
    }

    def end(result: MeasuredRise | float) -> None:
        if isinstance(result, MeasuredRise):
            report(result)

    found = collect(pieces, run or one_by_one(partial(measure_method, strategies)), end)
    cases: dict[str, MethodSummary] = {}
    for name in strategies:
        own = [found[key] for key, piece in pieces.items() if piece.way == name]
        rises = [result for result in own if isinstance(result, MeasuredRise)]
        hottest = summarize(result for result in own if isinstance(result, float))
        cases[name] = MethodSummary.of(rises, hottest_after_ten_rises_c=hottest if heat else UNSET)
    return CaseBench(
        name="methods",
        seed=seed,
        n=len(falls),
        robot=first.world.robot.name,
        scene=first.world.scene.name,
        torque_limit_nm=first.torque_limit.value,
        limit_by=first.torque_limit.by,
        cases=cases,
    )


def _sample(world: World, each: int, seed: int) -> list[Fall]:
    rng = np.random.default_rng(seed)
    return sample_falls(world, dict.fromkeys(BENCH_CLASSES, each), rng)


def list_pieces(
    falls: Sequence[Fall],
    seed: int,
    *,
    classes: Sequence[str] = BENCH_CLASSES,
    preflight: bool = True,
    way: str | UnsetType = UNSET,
) -> dict[str, RisePiece]:
    """List a rise from every fall; the falls are in the order of the classes, as many of each."""
    return {
        str(number): RisePiece(
            number=number,
            fall=fall,
            bench_class=classes[number * len(classes) // len(falls)],
            seed=seed,
            preflight=preflight,
            way=way,
        )
        for number, fall in enumerate(falls)
    }


def rise_all(
    pieces: Mapping[str, RisePiece], run: RunRises, report: Report, ledger: Ledger | None = None
) -> list[MeasuredRise]:
    """Do rises that a ledger does not hold yet; return all, in their order."""
    kept = ledger.done if ledger is not None else {}
    rises = {name: convert(kept[name], MeasuredRise) for name in pieces if name in kept}
    for rise in rises.values():
        report(rise)

    def end(name: str, rise: MeasuredRise) -> None:
        rises[name] = rise
        if ledger is not None:
            ledger.add(name, rise)
        report(rise)

    run({name: piece for name, piece in pieces.items() if name not in rises}, end)
    return [rises[name] for name in pieces]


def _list_method_pieces(
    falls: Sequence[Fall], seed: int, way: str, *, heat: bool
) -> dict[str, RisePiece | HeatPiece]:
    """List the rises of a method, and the rows of rises that heat its servos up."""
    rows = range(0, len(falls) - IN_A_ROW + 1, IN_A_ROW) if heat else ()
    return {
        **list_pieces(falls, seed, way=way),
        **{
            f"heat {k}": HeatPiece(falls=tuple(falls[k : k + IN_A_ROW]), seed=seed, way=way)
            for k in rows
        },
    }


def measure_method(
    strategies: Mapping[str, Strategy], piece: RisePiece | HeatPiece
) -> MeasuredRise | float:
    """Rise by the strategy of a piece; return its figures, or the hottest servo's temperature."""
    strategy = strategies[str(piece.way)]
    if isinstance(piece, HeatPiece):
        return _heat_up(strategy, piece.falls, piece.seed)
    return measure_rise(strategy, piece)


def measure_rise(strategy: Strategy, piece: RisePiece) -> MeasuredRise:
    """Rise on a fresh twin, by a method that may have a name."""
    rise = rise_from(strategy, piece.fall, piece.number, piece.seed, preflight=piece.preflight)
    return MeasuredRise(**vars(rise.figures()), bench_class=piece.bench_class, way=piece.way)


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


def _heat_up(strategy: Strategy, falls: Sequence[Fall], seed: int) -> float:
    """Rise and rest repeatedly; return the hottest servo's temperature at the end [°C]."""
    twin = Twin(strategy.world)
    simulation = twin.simulation
    temperature = simulation.temperature.copy()
    for number, fall in enumerate(falls):
        twin.place(fall.posture)
        simulation.temperature[:] = temperature
        options = SessionOptions(start_class=fall.start_class)
        rise_once(twin, strategy, [seed, 1, number], options)
        simulation.release()
        for _ in range(round(REST / twin.period)):
            simulation.step(simulation.steps_per_period)
            simulation.update_sensors(twin.period)
        temperature = simulation.temperature.copy()
    return float(temperature.max())
