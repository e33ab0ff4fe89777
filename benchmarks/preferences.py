"""Measures and draws what each preference of planned rises trades: time, torque, impact, margin.

The same settled falls for all, on the twin, one attempt each. In the case "no search" what stands
is taken as it is.

    python benchmarks/preferences.py measure --n 4 --seed 5 --json full.json
    python benchmarks/preferences.py measure --n 4 --seed 5 --torque-limit 2.5 --limit-by pwm \
        --json weak.json
    python benchmarks/preferences.py draw full.json weak.json --out preferences.png
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import tyro
from numpy.typing import NDArray
from script import counting

from drivers import Twin
from humanoid_getup.benchmarks.rise import BENCH_CLASSES
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.rise import RiseFigures
from humanoid_getup.experiments.falls import Fall, sample_falls
from humanoid_getup.experiments.judging.summary import RiseSummary, summarize
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.filtering.dynamics_filter import HARD_DISTURBANCE
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.preference import PREFERENCE_NAMES
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import TorqueLimit, load_robot
from robots.kinematics import place
from robots.servo import LimitMode
from robots.storage.encoding import to_json, to_plain
from robots.storage.files import write_atomically

NO_SEARCH = "no search"
NO_BUDGET = 1e-6  # s
WORLDS = 16  # hard worlds in which each plan is rolled out
SUMMARIZED = ("neck_delta_v_m_s", "hard_share", "plan_and_filter_s")
PANELS = {
    "stand_time_s": "start to stand [s]",
    "peak_torque_nm": "peak driving torque [N·m]",
    "rms_torque_nm": "RMS torque up to the stand [N·m]",
    "neck_delta_v_m_s": "largest Δv of the neck in 8 ms [m/s]",
    "self_collisions": "self-collisions of a rise",
    "hard_share": "stood in hard worlds [share]",
}


@dataclass(frozen=True, kw_only=True)
class HardRise(RiseFigures):
    """A rise, with how its motion does in hard worlds."""

    hard_share: float | None
    """Share of the rollouts that stood."""
    plan_and_filter_s: float


@dataclass(frozen=True, kw_only=True)
class Measure:
    """Get up from the same falls with every preference."""

    json: Path
    n: int = 4
    """Falls of each class: supine, prone, lateral."""
    seed: int = 5
    torque_limit: float | None = None
    """Of every servo [N·m]; none for all the torque it has."""
    limit_by: LimitMode | None = None
    """What the limit acts on; none for the robot's own."""
    robot: str = "op3"


@dataclass(frozen=True, kw_only=True)
class Draw:
    """Draw measured figures."""

    figures: Annotated[tuple[Path, ...], tyro.conf.Positional]
    out: Path


def measure(options: Measure) -> None:
    """Measure every preference; write after each."""
    world = World(load_robot(options.robot))
    limit = TorqueLimit(options.torque_limit, options.limit_by).on(world.robot)
    database = load_database(world.robot)
    classes: dict[str, int] = dict.fromkeys(BENCH_CLASSES, options.n)
    falls = sample_falls(world, classes, np.random.default_rng(options.seed))
    result: dict[str, Any] = {
        "seed": options.seed,
        "n": len(falls),
        "robot": world.robot.name,
        "torque_limit_nm": limit.value,
        "limit_by": limit.by,
        "cases": {},
    }
    strategies = {
        NO_SEARCH: PlannedRise(
            world, database, PlannerSettings(torque_limit=limit, search_budget=NO_BUDGET)
        )
    } | {
        name: PlannedRise(world, database, PlannerSettings(torque_limit=limit, prefer=name))
        for name in PREFERENCE_NAMES
    }
    with counting("rises", len(falls) * len(strategies)) as count:
        for name, strategy in strategies.items():
            rises = []
            for number, fall in enumerate(falls):
                rises.append(_rise(strategy, fall, [options.seed, 1, number]))
                count(1)
            summary = {key: summarize(getattr(r, key) for r in rises) for key in SUMMARIZED}
            result["cases"][name] = to_plain(RiseSummary.of(rises)) | summary | {"rises": rises}
            write_atomically(options.json, to_json(result))


def _rise(strategy: PlannedRise, fall: Fall, seed: list[int]) -> HardRise:
    with Twin(strategy.world, fall.posture) as twin:
        result = get_up(twin, strategy, seed=np.random.default_rng(seed), max_attempts=1)
    figures = result.figures()
    neck_delta_v, hard_share = None, None
    if result.plan.motion is not None:
        neck_delta_v, hard_share = _roll_out(strategy, fall, result.plan.motion.joint_target, seed)
    return HardRise(
        **vars(replace(figures, neck_delta_v_m_s=neck_delta_v)),
        hard_share=hard_share,
        plan_and_filter_s=figures.plan_s + figures.filter_s,
    )


def _roll_out(
    strategy: PlannedRise, fall: Fall, target: NDArray[np.float64], seed: list[int]
) -> tuple[float, float]:
    """Play targets (T, n) in hard worlds that no search saw; return neck Δv [m/s], and stands."""
    world = strategy.world
    lying = place(world.robot, world.model, fall.posture)
    rng = np.random.default_rng([*seed, 2])
    scenarios = HARD_DISTURBANCE.sample(world, lying, WORLDS, rng, strategy.torque_limit)
    outcome = Experiment(world).compare(scenarios, [target])
    return float(np.asarray(outcome.neck_delta_v)[0, 0]), float(outcome.stood.mean())


def draw(options: Draw) -> None:
    """Draw a panel for each figure: its median (bar) and every rise (dots), by preference."""
    results = [json.loads(file.read_text("utf-8")) for file in options.figures]
    figure, panels = plt.subplots(2, 3, figsize=(12.0, 6.5), layout="constrained")
    for axes, (key, label) in zip(panels.flat, PANELS.items(), strict=True):
        for i, result in enumerate(results):
            _draw_figure(axes, result, key, color=f"C{i}", shift=(i - 0.5) * 0.3)
        axes.set_xticks(range(len(results[0]["cases"])), results[0]["cases"], fontsize=8)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3, axis="y")
    panels.flat[0].legend(loc="lower left", fontsize=8)
    figure.savefig(options.out, dpi=110)


def _draw_figure(axes: Any, result: dict[str, Any], key: str, *, color: str, shift: float) -> None:
    for x, case in enumerate(result["cases"].values()):
        values = [r[key] for r in case["rises"] if r.get(key) is not None]
        # Counts are compared by their means: most are small whole numbers.
        middle = np.mean(values) if key == "self_collisions" else np.median(values)
        at = np.full(len(values), x + shift) + np.linspace(-0.06, 0.06, len(values))
        axes.plot(at, values, ".", color=color, alpha=0.35, markersize=5)
        label = _name_limit(result) if x == 0 else None
        axes.hlines(middle, x + shift - 0.13, x + shift + 0.13, color=color, lw=2.5, label=label)


def _name_limit(result: dict[str, Any]) -> str:
    limit = result["torque_limit_nm"]
    return "full torque" if limit is None else f"{limit:g} N·m by {result['limit_by'].upper()}"


def main(options: Measure | Draw) -> None:
    """Measure or draw."""
    if isinstance(options, Measure):
        measure(options)
    else:
        draw(options)


if __name__ == "__main__":
    main(tyro.cli(Measure | Draw, config=(tyro.conf.OmitArgPrefixes,)))
