"""Benchmark of the filter: speed of its simulation relative to bare physics."""

from __future__ import annotations

import time

import msgspec
import mujoco
import numpy as np

from humanoid_getup.benchmarks.bench_result import CaseBench
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.reference import straight_path
from humanoid_getup.motions.motion_database import Connection, MotionDatabase
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

SPEED = 3.0  # rad/s


class FilterSpeed(msgspec.Struct, frozen=True, kw_only=True):
    """Speed of the filter, as a share of a bare loop's."""

    n: int
    filter_over_bare_steps_per_s: float


def bench_filter(
    world: World, database: MotionDatabase, *, seed: int, repeats: int = 5
) -> CaseBench[FilterSpeed]:
    """Time the filter's simulation and a loop of ``mj_step`` over the same rises.

    Both step the same model through the same targets. The case ``one_thread`` compares
    one core with one loop; ``all_threads`` compares the filter as it is used with the same loop.
    """
    falls = sample_falls(world, {"supine": 2, "prone": 2}, np.random.default_rng(seed))
    cases: dict[str, list[float]] = {"one_thread": [], "all_threads": []}
    for _ in range(repeats):
        for key, threads in (("one_thread", 1), ("all_threads", 0)):
            ratios = [
                _compare(world, database.select(f.posture, 3), f.posture, threads) for f in falls
            ]
            cases[key].append(float(np.median(ratios)))
    return CaseBench(
        name="filter",
        seed=seed,
        n=repeats * len(falls),
        cases={
            key: FilterSpeed(n=len(v), filter_over_bare_steps_per_s=float(np.median(v)))
            for key, v in cases.items()
        },
    )


def _compare(world: World, connections: list[Connection], start: Posture, threads: int) -> float:
    """Return the filter's steps per second as a share of a bare loop's."""
    period = world.robot.control_period
    candidates = [
        Candidate(path=straight_path(start, align(c.posture, start), SPEED, period), connection=c)
        for c in connections
    ]
    dynamics_filter = DynamicsFilter(world, threads=threads)
    dynamics_filter.roll_out(start, candidates)  # compiles what later calls reuse
    began = time.perf_counter()
    rollouts = dynamics_filter.roll_out(start, candidates)
    filter_s = time.perf_counter() - began
    began = time.perf_counter()
    for one in rollouts:
        _step_bare(world, start, one.target)
    bare_s = time.perf_counter() - began
    return bare_s / filter_s


def _step_bare(world: World, start: Posture, target: Array) -> None:
    model = world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(world.robot, model, start)
    substeps = round(world.robot.control_period / model.opt.timestep)
    for row in target:
        data.ctrl[:] = row
        mujoco.mj_step(model, data, substeps)
