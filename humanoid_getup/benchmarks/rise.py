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
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.falls import Fall, sample_falls
from humanoid_getup.simulation.scene import Scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RiseOptions, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import FULL_TORQUE, Robot, TorqueLimit
from robots.quaternion import Array

CLASSES = ("supine", "prone", "lateral")


def bench_rise(
    robot: Robot,
    scene: Scene,
    *,
    seed: int,
    each: int = 20,
    options: RiseOptions | None = None,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Rise from ``each`` settled falls of every class on the twin.

    Args:
        robot: Robot that falls.
        scene: Where.
        seed: Of the falls and the plans.
        each: Falls of each class: supine, prone, lateral.
        options: Which halves of the method to use, under what torque limit.
        report: Called with the record of each rise.
    """
    options = options or RiseOptions()
    world = World(robot, scene)
    planner = PlannedRise(world, load_database(robot), options)
    falls = sample_falls(world, dict.fromkeys(CLASSES, each), np.random.default_rng(seed))
    attempt_options = AttemptOptions(
        max_attempts=1,
        torque_limit=options.torque_limit,
        preflight=options.filtering,  # an unfiltered path is played to see it fail or stand
    )
    records = []
    for number, fall in enumerate(falls):
        twin = Twin(world)
        session = RiseSession.on(twin, world, planner, attempt_options)
        record = _fall_and_rise(session, twin, fall, [seed, number]).record()
        record["bench_class"] = CLASSES[number // each]
        records.append(record)
        report(record)
    return {
        "name": "rise",
        "seed": seed,
        "n": len(records),
        "robot": robot.name,
        "scene": scene.name,
        "torque_limit_nm": options.torque_limit.value,
        "planning": options.planning,
        "filtering": options.filtering,
        "assistance": options.assistance,
        "classes": {
            name: summarize_records([r for r in records if r["bench_class"] == name])
            for name in CLASSES
        },
        "all": summarize_records(records),
        "rises": records,
    }


def _fall_and_rise(
    session: RiseSession,
    twin: Twin,
    fall: Fall,
    seed: list[int],
    temperature: Array | None = None,
) -> RiseResult:
    """Put a twin where it fell, its servos at given temperatures [°C], and get it up."""
    lay_down(session.world, fall, twin.place)
    if temperature is not None:
        twin.simulation.temperature[:] = temperature
    return run_session(session, np.random.default_rng(seed), start_class=fall.start_class)


IN_A_ROW = 10  # rises whose heat adds up
REST = 5.0  # s between them, torque off


def bench_methods(
    world: World,
    strategies: Mapping[str, Strategy],
    *,
    seed: int,
    each: int,
    torque_limit: TorqueLimit = FULL_TORQUE,
    heat: bool = True,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Get up from the same settled falls by several strategies, on the twin.

    Args:
        world: Robot and scene.
        strategies: What is compared, by name.
        seed: Of the falls and the plans.
        each: Falls of each class: supine, prone, lateral.
        torque_limit: Of the servos.
        heat: Whether ten rises in a row are made as well, to see how hot the servos become.
        report: Called with the record of each rise.
    """
    falls = sample_falls(world, dict.fromkeys(CLASSES, each), np.random.default_rng(seed))
    options = AttemptOptions(max_attempts=1, torque_limit=torque_limit)
    cases = {}
    for name, strategy in strategies.items():
        records = []
        for number, fall in enumerate(falls):
            twin = Twin(world)
            session = RiseSession.on(twin, world, strategy, options)
            record = _fall_and_rise(session, twin, fall, [seed, number]).record() | {"way": name}
            records.append(record)
            report(record)
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


def _heat_up(
    world: World, strategy: Strategy, falls: list[Fall], options: AttemptOptions, seed: int
) -> float:
    """Rise, rest, rise again; return the hottest servo's temperature at the end [°C]."""
    twin = Twin(world)
    body = twin.simulation
    warm = body.temperature.copy()
    for number, fall in enumerate(falls):
        session = RiseSession.on(twin, world, strategy, options)
        _fall_and_rise(session, twin, fall, [seed, number], warm)
        body.release()
        for _ in range(round(REST / twin.period)):
            body.step(body.steps_per_period)
            body.update_sensors(twin.period)
        warm = body.temperature.copy()
    return float(warm.max())
