"""Compare the speed of the filter's simulation with a loop of `mj_step` over the same rises.

Both step the same model through the same targets. `one_thread` compares one core with one loop,
`all_threads` the filter as it is used.

    python benchmarks/filter_speed.py --n 5 --json filter.json
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import mujoco
import numpy as np
import tyro
from script import Options, write_results

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.filtering.candidate import Candidate, straight_path
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.motions.motion_database import Connection, load_database
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place

SPEED = 3.0  # rad/s
FIGURES = ("n", "filter_over_bare_steps_per_s")
THREADS = {"one_thread": 1, "all_threads": 0}


@dataclass(frozen=True, kw_only=True)
class FilterOptions(Options):
    """Options of this script."""

    n: int = 5
    """Repetitions."""


def main(options: FilterOptions) -> None:
    """Measure, and write the median ratio of steps per second."""
    world = options.load_world()
    database = load_database(world.robot)
    falls = sample_falls(world, {"supine": 2, "prone": 2}, np.random.default_rng(options.seed))
    ratios = {
        case: [
            np.median(
                [compare(world, database.select(f.posture, 3), f.posture, threads) for f in falls]
            )
            for _ in range(options.n)
        ]
        for case, threads in THREADS.items()
    }
    cases = {
        case: {"n": len(found), "filter_over_bare_steps_per_s": float(np.median(found))}
        for case, found in ratios.items()
    }
    result = options.describe("filter", options.n * len(falls)) | {"cases": cases}
    write_results(result, FIGURES, options.json)


def compare(world: World, connections: list[Connection], start: Posture, threads: int) -> float:
    """Return the filter's steps per second as a share of a bare loop's."""
    period = world.robot.control_period
    candidates = [
        Candidate(path=straight_path(start, align(c.posture, start), SPEED, period), connection=c)
        for c in connections
    ]
    dynamics_filter = DynamicsFilter(world, PlannerSettings(threads=threads))
    dynamics_filter.roll_out(start, candidates)  # compiles what later calls reuse
    began = time.perf_counter()
    rollouts = dynamics_filter.roll_out(start, candidates)
    filter_s = time.perf_counter() - began
    began = time.perf_counter()
    for rollout in rollouts:
        data = mujoco.MjData(world.model)
        data.qpos[:] = place(world.robot, world.model, start)
        for row in rollout.target:
            data.ctrl[:] = row
            mujoco.mj_step(world.model, data, round(period / world.model.opt.timestep))
    return (time.perf_counter() - began) / filter_s


if __name__ == "__main__":
    main(tyro.cli(FilterOptions, description=__doc__))
