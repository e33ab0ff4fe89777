"""The main benchmark: rises from settled falls of every class."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from drivers import Twin
from humanoid_getup.bench.statistics import summarise_records
from humanoid_getup.database import load_database
from humanoid_getup.lying import sample_falls
from humanoid_getup.rise import rise
from humanoid_getup.rise_plan import RiseOptions
from humanoid_getup.rising import RisePlanner
from humanoid_getup.scene import Scene
from humanoid_getup.stage import Stage
from robots import Robot

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
    stage = Stage.build(robot, scene)
    planner = RisePlanner(stage, load_database(robot), options)
    falls = sample_falls(stage, dict.fromkeys(CLASSES, each), np.random.default_rng(seed))
    records = []
    for number, fall in enumerate(falls):
        twin = Twin(robot, stage.model, pwm_limited=options.pwm_limited)
        rng = np.random.default_rng([seed, number])
        record = rise(twin, planner, fall.posture, fall.start_class, rng).record()
        record["bench_class"] = CLASSES[number // each]
        records.append(record)
        report(record)
    return {
        "name": "rise",
        "seed": seed,
        "n": len(records),
        "robot": robot.name,
        "scene": scene.name,
        "torque_limit_nm": options.torque_limit,
        "planning": options.planning,
        "filtering": options.filtering,
        "assistance": options.assistance,
        "classes": {
            name: summarise_records([r for r in records if r["bench_class"] == name])
            for name in CLASSES
        },
        "all": summarise_records(records),
        "rises": records,
    }
