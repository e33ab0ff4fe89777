"""`getup bench planner` and `planner-cost`: path planners in scenes, and what planning costs."""

from __future__ import annotations

from typing import Any

from humanoid_getup.benchmarks.path_planning import planner, planner_cost
from humanoid_getup.benchmarks.path_planning.limited_checker import Budget
from humanoid_getup.benchmarks.path_planning.planning_problems import OWN_PLANNERS, Planner
from humanoid_getup.cli.bench import hand_over, run_benchmark
from humanoid_getup.cli.errors import BadInputError, needing, refusing
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.bench import BenchPlanner, BenchPlannerCost
from humanoid_getup.cli.output import counting, phase
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.reporting.planner_plot import save_planner_cost
from humanoid_getup.scenes.named_scenes import load_scene
from robots import Robot


def bench_planner(command: BenchPlanner) -> int:
    """Compare path planners on the same problems in scenes."""
    planners = find_planners(command.planners)
    with phase("loading"), refusing():
        robot = load_robot(command)
        load_database(robot)
        for name in command.scenes:
            load_scene(name, robot, command.seed)

    def bench(robot: Robot, **options: Any) -> dict[str, Any]:
        budget = Budget(checks=command.checks)
        return planner.bench_planner(
            robot, planners, scenes=command.scenes, budget=budget, **options
        )

    count = len(command.scenes) * command.n
    return run_benchmark(command, bench, robot, count=count, of="falls")


def bench_planner_cost(command: BenchPlannerCost) -> int:
    """Measure what planning costs with more joints and obstacles, and plot it if asked for."""
    count = len(planner_cost.JOINT_COUNTS) * len(planner_cost.OBSTACLES) * command.n
    with counting("problems", count) as advance:
        result = planner_cost.bench_planner_cost(
            seed=command.seed,
            each=command.n,
            budget=Budget(checks=command.checks),
            report=lambda _: advance(1),
        )
    if command.picture is not None:
        save_planner_cost(result, command.picture)
    return hand_over(result, command)


def find_planners(names: tuple[str, ...]) -> dict[str, Planner]:
    """Find planners by name; OMPL is imported if one is not the package's own.

    Raises:
        BadInputError: if there is no planner of a name, or OMPL is needed and missing.
    """
    known = dict(OWN_PLANNERS)
    if not set(names) <= set(known):
        with needing("bench"):
            from humanoid_getup.benchmarks.path_planning.ompl_planners import OMPL_PLANNERS
        known |= OMPL_PLANNERS
    for name in names:
        if name not in known:
            raise BadInputError(f"unknown planner '{name}': expected {', '.join(known)}")
    return {name: known[name] for name in names}
