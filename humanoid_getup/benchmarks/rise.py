"""Rises from many falls: one strategy by class, or several strategies on the same falls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drivers import Twin
from humanoid_getup.evaluation.statistics import summarize, summarize_records
from humanoid_getup.execution.get_up import lay_down, run_session
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.rise_session import AttemptOptions, RiseSession
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.simulation.falls import Fall, sample_falls
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RiseOptions, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import FULL_TORQUE, TorqueLimit
from robots.quaternion import Array

BENCH_CLASSES = ("supine", "prone", "lateral")
"""Start classes of benchmarks; left and right count as one."""
IN_A_ROW = 10  # rises whose heat adds up
REST = 5.0  # s between them, torque off

Report = Callable[[dict[str, Any]], None]


def bench_rise(
    world: World,
    database: MotionDatabase,
    *,
    seed: int,
    each: int = 20,
    options: RiseOptions | None = None,
    report: Report = lambda _: None,
) -> dict[str, Any]:
    """Rise from ``each`` settled falls of every class on the twin.

    Args:
        world: Robot and scene.
        database: Motions that plans end in.
        seed: Seed of the falls and the plans.
        each: Falls of each of `BENCH_CLASSES`.
        options: Whether to plan and to filter, under what torque limit.
        report: Called with the record of each rise.
    """
    options = options or RiseOptions()
    attempt_options = AttemptOptions(
        max_attempts=1,
        torque_limit=options.torque_limit,
        preflight=options.filtering,  # an unfiltered path is played to see whether it stands
    )
    falls = _sample(world, each, seed)
    records = _rise_all(
        world, PlannedRise(world, database, options), falls, attempt_options, seed, {}, report
    )
    return {
        "name": "rise",
        "seed": seed,
        "n": len(records),
        "robot": world.robot.name,
        "scene": world.scene.name,
        "torque_limit_nm": options.torque_limit.value,
        "planning": options.planning,
        "filtering": options.filtering,
        "assistance": options.assistance,
        "classes": {
            name: summarize_records([r for r in records if r["bench_class"] == name])
            for name in BENCH_CLASSES
        },
        "all": summarize_records(records),
        "rises": records,
    }


def bench_methods(
    world: World,
    strategies: Mapping[str, Strategy],
    *,
    seed: int,
    each: int,
    torque_limit: TorqueLimit = FULL_TORQUE,
    heat: bool = True,
    report: Report = lambda _: None,
) -> dict[str, Any]:
    """Get up from the same settled falls by several strategies, on the twin.

    Args:
        world: Robot and scene.
        strategies: Strategies to compare, by name.
        seed: Seed of the falls and the plans.
        each: Falls of each of `BENCH_CLASSES`.
        torque_limit: Torque limit of the servos.
        heat: Whether to measure how hot the servos become in ten rises in a row, too.
        report: Called with the record of each rise.
    """
    falls = _sample(world, each, seed)
    options = AttemptOptions(max_attempts=1, torque_limit=torque_limit)
    cases = {}
    for name, strategy in strategies.items():
        records = _rise_all(world, strategy, falls, options, seed, {"way": name}, report)
        cases[name] = summarize_records(records)
        if heat:
            rows = (falls[k : k + IN_A_ROW] for k in range(0, len(falls) - IN_A_ROW + 1, IN_A_ROW))
            hottest = [_heat_up(world, strategy, row, options, seed) for row in rows]
            cases[name]["hottest_after_ten_rises_c"] = summarize(hottest)
    return {
        "name": "methods",
        "seed": seed,
        "n": len(falls),
        "robot": world.robot.name,
        "scene": world.scene.name,
        "torque_limit_nm": torque_limit.value,
        "pwm_limited": torque_limit.by_pwm,
        "cases": cases,
    }


def _sample(world: World, each: int, seed: int) -> list[Fall]:
    rng = np.random.default_rng(seed)
    return sample_falls(world, dict.fromkeys(BENCH_CLASSES, each), rng)


def _rise_all(
    world: World,
    strategy: Strategy,
    falls: list[Fall],
    options: AttemptOptions,
    seed: int,
    label: dict[str, Any],
    report: Report,
) -> list[dict[str, Any]]:
    """Rise from every fall on a fresh twin; return the labeled record of each rise."""
    records = []
    for number, fall in enumerate(falls):
        twin = Twin(world)
        record = _fall_and_rise(twin, world, strategy, options, fall, [seed, number]).record()
        bench_class = BENCH_CLASSES[number * len(BENCH_CLASSES) // len(falls)]
        records.append(record | {"bench_class": bench_class} | label)
        report(records[-1])
    return records


def _fall_and_rise(
    twin: Twin,
    world: World,
    strategy: Strategy,
    options: AttemptOptions,
    fall: Fall,
    seed: list[int],
    temperature: Array | None = None,
) -> RiseResult:
    """Place a twin in a fall, its servos at given temperatures [°C], and get it up."""
    session = RiseSession.on(twin, world, strategy, options)
    lay_down(world, fall, twin.place)
    if temperature is not None:
        twin.simulation.temperature[:] = temperature
    return run_session(session, np.random.default_rng(seed), start_class=fall.start_class)


def _heat_up(
    world: World, strategy: Strategy, falls: list[Fall], options: AttemptOptions, seed: int
) -> float:
    """Rise and rest repeatedly; return the hottest servo's temperature at the end [°C]."""
    twin = Twin(world)
    simulation = twin.simulation
    temperature = simulation.temperature.copy()
    for number, fall in enumerate(falls):
        _fall_and_rise(twin, world, strategy, options, fall, [seed, number], temperature)
        simulation.release()
        for _ in range(round(REST / twin.period)):
            simulation.step(simulation.steps_per_period)
            simulation.update_sensors(twin.period)
        temperature = simulation.temperature.copy()
    return float(temperature.max())
