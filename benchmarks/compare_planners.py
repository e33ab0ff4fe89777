"""Compare path planners on the same problems in scenes: those of this package and of OMPL.

    python benchmarks/compare_planners.py --n 20 --seed 23 --json planner.json

OMPL is needed for its own planners only: ``pip install ompl``.
"""

from __future__ import annotations

from pathlib import Path

import tyro
from path_planning.comparison import SEARCH_FIGURES, bench_planner
from path_planning.limited_checker import Budget
from path_planning.planning_problems import OWN_PLANNERS, Planner
from script import counting, write_results

from robots import load_robot

SCENES = ("beam", "low-bed-a", "low-bed-b", "soft-bed", "table", "wall")
PLANNERS = ("refined", "strict", "RRTConnect", "KPIECE1")


def main(
    robot: str = "op3",
    n: int = 20,
    seed: int = 0,
    scenes: tuple[str, ...] = SCENES,
    planners: tuple[str, ...] = PLANNERS,
    checks: int = 50_000,
    json: Path | None = None,
) -> None:
    """Plan from n falls in each scene with every planner, within a number of checks each.

    Args:
        robot: Name or folder of a robot.
        n: Falls in each scene, evenly of the ways in which robots lie there.
        seed: Of falls and searches.
        scenes: Names or files of scenes.
        planners: refined: strictly, then from loose to strict; strict: strictly only; RRTConnect
            and KPIECE1: those of OMPL.
        checks: Postures that a planner may check for collisions, for each problem.
        json: File for the results.
    """
    with counting("falls", len(scenes) * n) as advance:
        result = bench_planner(
            load_robot(robot),
            find_planners(planners),
            seed=seed,
            each=n,
            scenes=scenes,
            budget=Budget(checks=checks),
            report=lambda _: advance(1),
        )
    write_results(result, (*SEARCH_FIGURES, "length_median", "both", "time_s_ratio"), json)


def find_planners(names: tuple[str, ...]) -> dict[str, Planner]:
    """Find planners by name; OMPL is imported if one is not the package's own.

    Raises:
        KeyError: if there is no planner of a name.
        ModuleNotFoundError: if OMPL is needed and missing.
    """
    known = dict(OWN_PLANNERS)
    if not set(names) <= set(known):
        from path_planning.ompl_planners import OMPL_PLANNERS

        known |= OMPL_PLANNERS
    return {name: known[name] for name in names}


if __name__ == "__main__":
    tyro.cli(main)
