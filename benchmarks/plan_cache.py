"""Compare rises by a plan from the cache with rises that are newly planned, on the same falls.

Falls settle, and each is planned once, into a cache. Then every fall is perturbed by an angle: a
normal error of that standard deviation in every joint, and in the root's rotation about a random
axis; and settles again with torque off. The twin is placed there twice, and gets up by a fresh
plan and by the cache, both through preflight and supervisor, in one attempt. An angle of 0 leaves
the fall as it is. A rise from the cache for which no plan was near enough is newly planned; these
are counted, and their times are not among those of the cache.

    python benchmarks/plan_cache.py --n 24 --seed 31 --json plan_cache.json
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console

from drivers import Twin
from humanoid_getup.cli.shared.console import counting, format_figure, make_table
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.starts.falls import CLASSES, sample_falls, settle_posture
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.cached_rise import CachedRise, KeptPlan
from humanoid_getup.strategies.cache.plan_cache import PlanCache
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, TorqueLimit, load_robot, quaternion
from robots.kinematics import read_posture
from robots.servo import LimitMode
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically


@dataclass
class Tally:
    """How the rises of one strategy ended."""

    n: int = 0
    stood: int = 0
    reused: int = 0
    seconds: list[float] = field(default_factory=list)
    """Wall time of planning and filtering [s]; from the cache, of the plans that were reused."""
    distances: list[float] = field(default_factory=list)

    def add(self, result: RiseResult, *, cached: bool) -> None:
        """Count a rise."""
        plan = result.plan
        near = plan.nearness if isinstance(plan, KeptPlan) else None
        self.n, self.stood = self.n + 1, self.stood + result.stood
        self.reused += near is not None
        if near is not None:
            self.distances.append(near.distance)
        if near is not None or not cached:
            self.seconds.append(plan.plan_s + plan.filter_s)

    def record(self) -> dict[str, Any]:
        """Return the figures."""
        figures: dict[str, Any] = {"n": self.n, "stood": self.stood, "reused": self.reused}
        figures["stood_95"] = wilson_interval(self.stood, self.n)
        if self.seconds:
            figures["plan_and_filter_s"] = _summarize(self.seconds)
        if self.distances:
            figures["distance"] = _summarize(self.distances)
        return figures


def _summarize(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p95": float(np.percentile(values, 95))}


def perturb(world: World, start: Posture, angle: float, rng: np.random.Generator) -> Posture:
    """Perturb joints and root by a standard deviation [rad], and settle with torque off."""
    if angle == 0.0:
        return start
    robot = world.robot
    axis = rng.normal(size=3)
    turn = quaternion.from_axis_angle(axis / np.linalg.norm(axis), rng.normal(scale=angle))
    joint_pos = start.joint_pos + rng.normal(scale=angle, size=robot.n)
    lifted = replace(
        start,
        position=start.position + np.array([0.0, 0.0, 0.01]),
        orientation=quaternion.multiply(turn, start.orientation),
        joint_pos=np.clip(joint_pos, robot.lower, robot.upper),
    )
    return read_posture(robot, world.model, settle_posture(world, lifted))


def rise(strategy: Strategy, start: Posture, seed: int) -> RiseResult:
    """Get the twin up from a posture, in one attempt."""
    with Twin(strategy.world, start, limit_by=strategy.torque_limit.by) as twin:
        options = SessionOptions(settle=False)
        rng = np.random.default_rng(seed)
        return get_up(twin, strategy, seed=rng, max_attempts=1, options=options)


def main(
    n: int = 24,
    seed: int = 31,
    angles: Sequence[float] = (0.0, 1.0, 2.0, 3.0, 5.0),
    torque_limit: float | None = None,
    limit_by: LimitMode | None = None,
    json: Path | None = None,
) -> None:
    """Perturb n falls by angles [deg], and compare both ways to plan."""
    world = World(load_robot("op3"))
    limit = TorqueLimit(torque_limit, limit_by).on(world.robot)
    rng = np.random.default_rng(seed)
    falls = sample_falls(world, dict.fromkeys(CLASSES, n // len(CLASSES)), rng)
    tallies = {(angle, way): Tally() for angle in angles for way in ("fresh", "cache")}
    planner = PlannedRise(world, torque_limit=limit)
    with tempfile.TemporaryDirectory() as folder, counting("falls", len(falls)) as advance:
        for number, fall in enumerate(falls):
            solved = Path(folder, str(number))
            rise(CachedRise(planner, PlanCache(solved)), fall.posture, seed)
            for angle in angles:
                copy = shutil.copytree(solved, Path(folder, f"{number} by {angle:g}"))
                start = perturb(world, fall.posture, np.radians(angle), rng)
                cached = CachedRise(planner, PlanCache(copy))
                for way, strategy in (("fresh", planner), ("cache", cached)):
                    result = rise(strategy, start, seed + 1)
                    tallies[angle, way].add(result, cached=way == "cache")
            advance(1)
    rows = {f"{angle:g} deg, {way}": tally.record() for (angle, way), tally in tallies.items()}
    print_table(rows)
    if json is not None:
        record = {"name": "plan_cache", "seed": seed, "n": len(falls), "cases": rows}
        write_atomically(json, to_json(record))


def print_table(rows: dict[str, dict[str, Any]]) -> None:
    """Print the figures."""
    headings = ("n", "stood", "stood_95", "reused", "plan_and_filter_s", "distance")
    table = make_table(("perturbed by", *headings), left=("perturbed by",))
    for name, row in rows.items():
        table.add_row(name, *(format_figure(row[key]) if key in row else "" for key in headings))
    Console().print(table)


if __name__ == "__main__":
    tyro.cli(main)
