"""Benchmark of path planners: same problems, same collision checker, same budget, one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from rise_in_scenes import list_scene_falls

from humanoid_getup.experiments.judging.summary import summarize, wilson_interval
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from path_planning.limited_checker import Budget
from path_planning.planning_problems import (
    Planner,
    ProblemMaker,
    draw_seed,
)
from robots import Robot

REFERENCE = "RRTConnect"
"""The planner beside which the others are timed."""
ALL = "all"
SEARCH_FIGURES = ("n", "found", "found_interval_95", "time_s", "checks_median")
"""Figures of every search."""

Records = list[dict[str, Any]]


def bench_planner(
    robot: Robot,
    planners: Mapping[str, Planner],
    *,
    seed: int,
    each: int,
    scenes: Sequence[str],
    budget: Budget | None = None,
    report: Callable[[Records], None] = lambda _: None,
) -> dict[str, Any]:
    """Plan from falls to the nearest connecting posture that is free there, with every planner.

    Shortening and smoothing are left out: only the searches are compared.

    Args:
        robot: Robot.
        planners: Planners to compare, by name.
        seed: Of falls and searches.
        each: Falls in each scene.
        scenes: Names or files of scenes.
        budget: Of every planner for each problem.
        report: Called with the records of each fall, none where no goal is free.
    """
    database, budget = load_database(robot), budget or Budget()
    records: Records = []
    falls = dict.fromkeys(scenes, 0)
    for scene in scenes:
        lying = list_scene_falls(robot, scene, each, seed)
        for ground, own in groupby(lying, lambda piece: piece.ground):
            maker = ProblemMaker(World(robot, load_scene(scene, robot, ground)))
            for piece in own:
                fall, number = piece.fall, piece.number
                falls[scene] += 1
                goals = database.select(fall.posture, len(database.rising))
                rng = np.random.default_rng([seed, 1, number])
                problem = maker.pose_nearest(fall.posture, (g.posture for g in goals), rng)
                label = {"case": scene, "fall": number, "start_class": fall.start_class}
                own_seed, new = draw_seed(seed, 2, number), []
                if problem is not None:
                    for name, planner in planners.items():
                        attempt = maker.attempt(problem, planner, own_seed, budget)
                        new.append(label | {"planner": name} | attempt.record())
                records += new
                report(new)
    return {
        "name": "planner",
        "seed": seed,
        "n": each,
        "robot": robot.name,
        "budget_checks": budget.checks,
        "skipped": {scene: falls[scene] - _count_falls(records, scene) for scene in scenes},
        "cases": {
            f"{scene}: {name}": compare(records, scene, name)
            for scene in (*scenes, ALL)
            for name in planners
        },
        "problems": records,
    }


def compare(records: Records, scene: str, planner: str) -> dict[str, Any]:
    """Summarize a planner's problems of a scene or of all, and compare it with the reference.

    Times and checks are of all problems, those without a path included; lengths of those with
    one; ratios, planner over reference, of those for which both have one.
    """
    ours, reference = (_select(records, scene, name) for name in (planner, REFERENCE))
    both = [(a, b) for a, b in zip(ours, reference, strict=False) if a["found"] and b["found"]]
    return summarize_attempts(ours) | {
        "both": len(both),
        **{
            f"{key}_ratio": float(np.median([a[key] / b[key] for a, b in both])) if both else None
            for key in ("time_s", "checks", "length")
        },
    }


def summarize_attempts(records: Records) -> dict[str, Any]:
    """Count the paths found; take the medians of time [s], checks and length."""
    found = sum(record["found"] for record in records)
    return {
        "n": len(records),
        "found": found,
        "found_interval_95": wilson_interval(found, len(records)),
        "time_s": summarize(r["time_s"] for r in records),
        "checks_median": round(float(np.median([r["checks"] for r in records] or [0]))),
        "length_median": summarize(r["length"] for r in records).median,
    }


def _select(records: Records, scene: str, planner: str) -> Records:
    return [r for r in records if r["planner"] == planner and scene in (r["case"], ALL)]


def _count_falls(records: Records, scene: str) -> int:
    return len({r["fall"] for r in records if r["case"] == scene})
