"""Benchmark of what planning costs: with more obstacles, with more joints, and each check."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from humanoid_getup.experiments.falls import CLASSES
from humanoid_getup.experiments.judging.summary import summarize
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.posture_space import PostureProblem
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from path_planning.clutter import sample_lying, sample_obstacles
from path_planning.comparison import Records, summarize_attempts
from path_planning.generic_humanoid import JOINT_COUNTS, make_humanoid
from path_planning.limited_checker import Budget
from path_planning.planning_problems import (
    ProblemMaker,
    draw_seed,
    search_refined,
)
from robots import Posture, Robot
from robots.kinematics import place
from robots.quaternion import Array

OBSTACLES = (0, 1, 2, 4, 8, 16, 32, 64)
TIMED = 100  # postures whose checks are timed
REPEATS = 3  # of which the quickest counts


def bench_planner_cost(
    *,
    seed: int,
    each: int,
    joints: Sequence[int] = JOINT_COUNTS,
    obstacles: Sequence[int] = OBSTACLES,
    budget: Budget | None = None,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Plan between lying postures of generic humanoids, on open ground and among obstacles.

    The robots have the same shapes with any number of joints. The problems of a robot are the same
    with any number of obstacles, and where there are more, the fewer are among them.

    Args:
        seed: Of postures, obstacles and searches.
        each: Problems of every case.
        joints: Numbers of joints, of `JOINT_COUNTS`.
        obstacles: Numbers of obstacles.
        budget: Of the planner for each problem.
        report: Called with the record of each problem.
    """
    budget = budget or Budget()
    records: Records = []
    with tempfile.TemporaryDirectory() as folder:
        for count in joints:
            own = Path(folder, str(count))
            own.mkdir()
            world = World(make_humanoid(count, own))
            for problem in range(each):
                for record in _plan(world, obstacles, budget, seed, problem):
                    records.append(record)
                    report(record)
    cases = dict.fromkeys(_name(r) for r in records)
    return {
        "name": "planner-cost",
        "seed": seed,
        "n": each,
        "budget_checks": budget.checks,
        "cases": {case: _summarize([r for r in records if _name(r) == case]) for case in cases},
        "problems": records,
    }


def _plan(
    world: World, obstacles: Sequence[int], budget: Budget, seed: int, number: int
) -> Records:
    """Plan a problem among each number of obstacles."""
    robot = world.robot
    classes = np.random.default_rng([seed, number]).choice(CLASSES, 2).tolist()
    rng = np.random.default_rng([seed, number, robot.n])
    start, goal = _sample_ends(world, classes, rng)
    clutter = sample_obstacles(robot, (start, goal), max(obstacles), rng)
    records: Records = []
    for count in obstacles:
        scene = replace(FLAT_SCENE, name=f"{count} obstacles", obstacles=clutter[:count])
        maker = ProblemMaker(World(robot, scene))
        problem = maker.pose_problem(start, goal, rng)
        if problem is None:
            raise ValueError(f"problem {number} cannot be posed among {count} obstacles")
        attempt = maker.attempt(problem, search_refined, draw_seed(seed, 2, number), budget)
        label = {"joints": robot.n, "obstacles": count, "problem": number}
        records.append(label | attempt.record() | time_checks(maker, problem, rng))
    return records


def _sample_ends(
    world: World, classes: Sequence[str], rng: np.random.Generator
) -> tuple[Posture, Posture]:
    """Draw two lying postures, the second turned and moved to the first."""
    maker = ProblemMaker(world)
    while True:
        start, goal = (sample_lying(world, start_class, rng) for start_class in classes)
        goal = align(goal, start)
        if maker.pose_problem(start, goal, rng) is not None:
            return start, goal


def time_checks(
    maker: ProblemMaker, problem: PostureProblem, rng: np.random.Generator
) -> dict[str, float]:
    """Time the check of a posture, and MuJoCo's kinematics and collision detection alone."""
    nodes = np.array([problem.sample(rng) for _ in range(TIMED)])
    configurations = problem.configurations(nodes)
    check = _time(maker.checker.is_free, configurations)
    bare = _time(*_make_bare(maker.world.robot, maker.checker.scene.compile, configurations))
    return {"check_us": 1e6 * check, "bare_us": 1e6 * bare, "check_over_bare": check / bare}


def _make_bare(
    robot: Robot, compile_scene: Callable[[Robot], mujoco.MjModel], configurations: Array
) -> tuple[Callable[[Array], object], Array]:
    """Make the function that only places a robot, and the MuJoCo positions for it, (K, nq)."""
    model = compile_scene(robot)
    data = mujoco.MjData(model)

    def place_bare(qpos: Array) -> None:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)

    rows = [
        place(robot, model, Posture(position=c[:3], orientation=c[3:7], joint_pos=c[7:]))
        for c in configurations
    ]
    return place_bare, np.array(rows)


def _time(function: Callable[[Array], object], rows: Array) -> float:
    """Return the time of a call [s], on average over the rows."""
    times: list[float] = []
    for _ in range(REPEATS):
        began = time.thread_time()
        for row in rows:
            function(row)
        times.append(time.thread_time() - began)
    return min(times) / len(rows)


def _name(record: dict[str, Any]) -> str:
    return f"{record['joints']} joints, {record['obstacles']} obstacles"


def _summarize(records: Records) -> dict[str, Any]:
    times = {
        key: summarize(r[key] for r in records)
        for key in ("check_us", "bare_us", "check_over_bare")
    }
    label = {key: records[0][key] for key in ("joints", "obstacles")}
    return label | summarize_attempts(records) | times
