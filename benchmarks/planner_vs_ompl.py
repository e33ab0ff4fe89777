"""Compare RRT-blossom with OMPL's RRTConnect: same problems, same collision checker, one run.

Both search for a path between the same postures in the same process, and check edges by
the same function at the same resolution. OMPL searches the joint angles and one
parameter that turns the root along the arc from start to goal; RRT-blossom may leave
the arc. Shortening and smoothing are left out: only the search is compared.

    python benchmarks/planner_vs_ompl.py --seed 0 --json planner.json
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.posture_metric import PostureMetric, align
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.path_planner import PathOptions, find_path
from humanoid_getup.planning.posture_space import PostureProblem
from humanoid_getup.planning.shortcut import length
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.simulation.world import World
from robots import Posture, load_robot, quaternion
from robots.quaternion import Array

COUNTS = {"supine": 20, "prone": 20, "lateral": 20}


@dataclass(frozen=True)
class Attempt:
    """Result of a planner on one problem."""

    planned: bool
    time_s: float
    checks: int
    """Postures checked for collisions."""
    length: float
    """Of the path found, in the posture metric; nan without one."""


def search_blossom(problem: PostureProblem, seed: int) -> list[Array]:
    """Search with this package: strictly, then from loose to strict."""
    return find_path(problem, np.random.default_rng(seed), PathOptions()).path


class SameEdges(ob.MotionValidator):
    """Lets OMPL check its edges by RRT-blossom's own function."""

    def __init__(
        self,
        info: ob.SpaceInformation,
        problem: PostureProblem,
        to_node: Callable[[Any], Array],
    ) -> None:
        super().__init__(info)
        self.problem, self.to_node = problem, to_node

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:
        """Return whether the edge from ``a`` to ``b`` is free."""
        return not self.problem.fails(self.to_node(a), self.to_node(b))


def search_ompl(problem: PostureProblem, limit: float) -> list[Array]:
    """Search with OMPL's RRTConnect, whose range it sets itself.

    The axes are scaled by the metric's weights, so its distances are those of the metric
    but for the Pythagorean sum.
    """
    turn = 0.5 * float(quaternion.angle_between(problem.start[:4], problem.goal[:4]))
    arc = problem.root_weight * turn
    scale = np.concatenate([[max(arc, 1e-6)], problem.scale])

    def to_node(state: Any) -> Array:
        values = np.array([state[k] for k in range(len(scale))]) / scale
        q = quaternion.slerp(problem.start[:4], problem.goal[:4], float(values[0]))
        return np.concatenate([q, values[1:]])

    space = ob.RealVectorStateSpace(len(scale))
    bounds = ob.RealVectorBounds(len(scale))
    lower, upper = np.append(0.0, problem.lower) * scale, np.append(1.0, problem.upper) * scale
    for k in range(len(scale)):
        bounds.setLow(k, float(lower[k]))
        bounds.setHigh(k, float(upper[k]))
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    info = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: problem.is_free(to_node(state)))
    info.setMotionValidator(SameEdges(info, problem, to_node))
    ends: list[Any] = [space.allocState(), space.allocState()]
    for state, share, node in zip(ends, (0.0, 1.0), (problem.start, problem.goal), strict=True):
        for k, value in enumerate(np.append(share, node[4:]) * scale):
            state[k] = float(value)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(og.RRTConnect(info))
    setup.solve(limit)
    if not setup.haveExactSolutionPath():
        return []
    return [to_node(state) for state in setup.getSolutionPath().getStates()]


def compare(
    starts: Sequence[Posture], goals: Sequence[Posture], checker: CollisionChecker, limit: float
) -> dict[str, list[Attempt]]:
    """Let both planners plan from each start to its goal.

    Args:
        starts: Lying postures.
        goals: A connecting posture for each, anywhere on the ground.
        checker: The scene.
        limit: Time that OMPL is given for a problem [s]; RRT-blossom has its edge budget.
    """
    attempts: dict[str, list[Attempt]] = {"rrt_blossom": [], "ompl_rrt_connect": []}
    for seed, (start, goal) in enumerate(zip(starts, goals, strict=True)):
        for name, search in (
            ("rrt_blossom", lambda problem, seed=seed: search_blossom(problem, seed)),
            ("ompl_rrt_connect", lambda problem: search_ompl(problem, limit)),
        ):
            problem = _pose(checker, start, align(goal, start))
            checks, began = checker.checks, time.perf_counter()
            path = search(problem)
            took = time.perf_counter() - began
            far = length(problem, path) if path else float("nan")
            attempts[name].append(Attempt(bool(path), took, checker.checks - checks, far))
    return attempts


def summarize(attempts: list[Attempt]) -> dict[str, float]:
    """Count the successes and take the medians and 95th percentiles."""
    times = [attempt.time_s for attempt in attempts]
    return {
        "n": len(attempts),
        "planned": sum(attempt.planned for attempt in attempts),
        "time_s_median": float(np.median(times)),
        "time_s_p95": float(np.percentile(times, 95)),
        "checks_median": float(np.median([attempt.checks for attempt in attempts])),
        "length_median": float(np.nanmedian([attempt.length for attempt in attempts])),
    }


def _pose(checker: CollisionChecker, start: Posture, goal: Posture) -> PostureProblem:
    checker.reset()
    faults = [fault for fault in (checker.allow(start), checker.allow(goal)) if fault]
    if faults:
        raise ValueError("; ".join(faults))
    positions = np.stack([start.position, goal.position])
    return PostureProblem(checker, PostureMetric.of(checker.robot), start, goal, positions)


def main(
    *,
    robot: str = "op3",
    scene: str = "flat",
    seed: int = 0,
    limit: float = 10.0,
    json: Path | None = None,
) -> None:
    """Compare RRT-blossom with OMPL's RRTConnect.

    Args:
        robot: Name of a robot.
        scene: Name of a scene.
        seed: Seed of the falls and of both planners.
        limit: OMPL's time for a problem [s].
        json: File for the results.
    """
    world = World(load_robot(robot), scene)
    ou.setLogLevel(ou.LOG_ERROR)
    ou.RNG.setSeed(seed + 1)  # once: OMPL seeds all later generators from it
    falls = sample_falls(world, COUNTS, np.random.default_rng(seed))
    database = load_database(world.robot)
    starts = [fall.posture for fall in falls]
    goals = [database.select(start)[0].posture for start in starts]
    attempts = compare(starts, goals, CollisionChecker(world.robot, world.scene), limit)
    table = {name: summarize(rows) for name, rows in attempts.items()}
    for name, row in table.items():
        print(
            f"{name:18s} {row['planned']:.0f}/{row['n']:.0f} planned, "
            f"median {1e3 * row['time_s_median']:.1f} ms, 95 % {1e3 * row['time_s_p95']:.1f} ms, "
            f"{row['checks_median']:.0f} checks, length {row['length_median']:.2f}",
            file=sys.stderr,
        )
    if json:
        head: dict[str, Any] = {"name": "planner_vs_ompl", "seed": seed}
        record = {**head, "n": len(starts), "cases": table}
        json.write_text(dumps(record, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
