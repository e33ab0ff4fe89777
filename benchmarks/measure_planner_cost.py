"""Measure what planning costs, with more and more joints, among more and more obstacles.

python benchmarks/measure_planner_cost.py --n 20 --seed 0 --json cost.json --picture cost.png
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import tyro
from path_planning.comparison import SEARCH_FIGURES
from path_planning.cost import OBSTACLES, bench_planner_cost
from path_planning.generic_humanoid import JOINT_COUNTS
from path_planning.limited_checker import Budget
from path_planning.plot import save_planner_cost
from script import counting, write_results


def main(
    n: int = 20,
    seed: int = 0,
    checks: int = 50_000,
    joints: Sequence[int] = JOINT_COUNTS,
    obstacles: Sequence[int] = OBSTACLES,
    picture: Path | None = None,
    json: Path | None = None,
) -> None:
    """Plan n problems of each case for generic humanoids.

    Args:
        n: Problems of each case.
        seed: Of postures, obstacles and searches.
        checks: Postures that the planner may check for collisions, for each problem.
        joints: Numbers of joints.
        obstacles: Numbers of obstacles.
        picture: PNG file for a plot of the results.
        json: File for the results.
    """
    with counting("problems", len(joints) * len(obstacles) * n) as advance:
        result = bench_planner_cost(
            seed=seed,
            each=n,
            joints=joints,
            obstacles=obstacles,
            budget=Budget(checks=checks),
            report=lambda _: advance(1),
        )
    if picture is not None:
        save_planner_cost(result, picture)
    write_results(result, (*SEARCH_FIGURES, "check_us", "check_over_bare"), json)


if __name__ == "__main__":
    tyro.cli(main)
