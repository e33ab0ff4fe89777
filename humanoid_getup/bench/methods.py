"""Ways of getting up side by side: plans and policies, from the same falls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drivers import Twin
from humanoid_getup.attempt import AttemptOptions, Plans
from humanoid_getup.bench.rise import CLASSES
from humanoid_getup.bench.statistics import summarise, summarise_records
from humanoid_getup.lying import Fall, sample_falls
from humanoid_getup.rise import lay_down_and_get_up
from humanoid_getup.stage import Stage

IN_A_ROW = 10  # rises whose heat adds up
REST = 5.0  # s between them, lying limp


def bench_methods(
    stage: Stage,
    ways: Mapping[str, Plans],
    *,
    seed: int,
    each: int,
    torque_limit: float | None = None,
    pwm_limited: bool = False,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Get up from the same settled falls in several ways, through the whole loop on the twin.

    Args:
        stage: Robot and scene.
        ways: Finds what to play, by the way's name.
        seed: Of the falls and the plans.
        each: Falls of each class: supine, prone, lateral.
        torque_limit: Cap on every servo [N·m].
        pwm_limited: The cap is a PWM limit, as servos in position mode have it.
        report: Called with the record of each rise.
    """
    falls = sample_falls(stage, dict.fromkeys(CLASSES, each), np.random.default_rng(seed))
    options = AttemptOptions(max_attempts=1, torque_limit=torque_limit, pwm_limited=pwm_limited)
    cases = {}
    for name, plans in ways.items():
        records, heat = [], []
        for number, fall in enumerate(falls):
            twin = Twin(stage.robot, stage.model, pwm_limited=pwm_limited)
            rng = np.random.default_rng([seed, number])
            rise = lay_down_and_get_up(twin, stage, plans, fall, rng, options)
            record = rise.record() | {"way": name}
            records.append(record)
            report(record)
        for first in range(0, len(falls) - IN_A_ROW + 1, IN_A_ROW):
            heat.append(_heat_up(stage, plans, falls[first : first + IN_A_ROW], options, seed))
        cases[name] = summarise_records(records) | {
            "hottest_after_ten_rises_c": summarise(heat),
        }
    return {
        "name": "methods",
        "seed": seed,
        "n": len(falls),
        "robot": stage.robot.name,
        "scene": stage.scene.name,
        "torque_limit_nm": torque_limit,
        "pwm_limited": pwm_limited,
        "cases": cases,
    }


def _heat_up(
    stage: Stage, plans: Plans, falls: list[Fall], options: AttemptOptions, seed: int
) -> float:
    """Rise, rest, rise again; return the hottest servo's temperature at the end [°C]."""
    twin = Twin(stage.robot, stage.model, pwm_limited=options.pwm_limited)
    body = twin.simulation
    warm = body.temperature.copy()
    for number, fall in enumerate(falls):
        rng = np.random.default_rng([seed, number])
        lay_down_and_get_up(twin, stage, plans, fall, rng, options, temperature=warm)
        body.release()
        for _ in range(round(REST / twin.period)):
            body.step(body.steps_per_period)
            body.feel(twin.period)
        warm = body.temperature.copy()
    return float(warm.max())
