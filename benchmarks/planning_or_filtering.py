"""What planning brings to a rise and what filtering brings: table 2 of [Lin12], without a jury.

The same settled falls for the whole method, for paths and motions without the dynamics filter, and
for straight interpolation, instead of a planned path, with the filter. The motions that come out
are measured as they are, as they would be watched; then they are played on the twin. Captured
rises of the robot, if it has any, stand beside them, each played from its own start.

    python benchmarks/planning_or_filtering.py --n 20 --seed 0 --json planning_or_filtering.json
    python benchmarks/planning_or_filtering.py --robot human --n 5 --json natural.json
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from script import counting

from drivers import Twin
from humanoid_getup.benchmarks.rise import BENCH_CLASSES
from humanoid_getup.commands.console import format_figure, make_table
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import Fall, sample_falls
from humanoid_getup.experiments.judging.outcome import APART, Outcome, count_episodes
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.experiments.judging.summary import summarize, wilson_interval
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions.motion import CAPTURED, MIRRORED_SUFFIX, Motion, hold_last
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.motions.time_alignment import find_nearest
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.preflight import preflight
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import load_robot
from robots.body.limbs import ARMS, Limbs
from robots.ground import GROUND
from robots.kinematics import place, place_postures
from robots.quaternion import Array
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

DEEP = 0.001  # m of self-penetration
NEAR = 0.002  # m over the ground up to which a hand or foot counts as on it
VOLTAGE = 12.0  # V


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Figures of how plausible a motion is, without a simulation."""

    ground_depth_m: float
    """Greatest depth of the robot in the ground."""
    slip_m: float
    """Distance that hands and feet slide while they are on the ground, all together."""
    self_collisions: int
    """Number of times that it is more than 1 mm inside itself, 0.1 s or more apart."""
    jerk_rad_s3: float
    """RMS of the third derivative of the joint angles."""
    landings: int
    """Number of times that a hand, knee or any other body besides the feet comes to the ground."""
    captured_distance: float | None
    """Mean distance from the nearest captured rise, aligned in time; None without another one."""


def measure_quality(world: World, motion: Motion, captured: Sequence[Motion] = ()) -> Quality:
    """Measure a motion as it is, on flat ground, and its distance from other, captured ones."""
    robot, model = world.robot, world.scene.compile(world.robot)
    model.geom_margin[model.geom(GROUND).id] = NEAR
    feet = [int(model.site(site).bodyid[0]) for site in robot.sole_sites]
    body = Limbs(robot)
    arms = [body.all[name] for name in ARMS if name in body.all]
    hands = [robot.joint_names[arm.middle if arm.end is None else arm.end] for arm in arms]
    limbs = {*feet, *(int(model.joint(name).bodyid[0]) for name in hands)}
    data = mujoco.MjData(model)
    rows = place_postures(robot, model, motion.position, motion.orientation, motion.joint_pos)
    depth, slip, overlap = 0.0, 0.0, np.zeros(len(rows))
    before: dict[int, Array] = {}
    touches = np.zeros((len(rows), model.nbody), dtype=bool)
    for k, qpos in enumerate(rows):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        slip += _measure_slip(data, before)
        mujoco.mj_collision(model, data)
        pairs = model.geom_bodyid[data.contact.geom]
        on_ground = (pairs == 0).any(axis=1)
        depth = max(depth, float(np.max(-data.contact.dist[on_ground], initial=0.0)))
        touches[k, pairs[on_ground].max(axis=1)] = True
        overlap[k] = np.max(-data.contact.dist[~on_ground], initial=0.0)
        before = _find_touching(data, pairs, on_ground, limbs)
    apart = round(APART / robot.control_period)
    others = np.delete(touches, feet, axis=1)
    landed = count_episodes(others.T, apart).sum() - others[0].sum()  # but for where it lies
    own = motion.name.removesuffix(MIRRORED_SUFFIX)
    others = [each for each in captured if each.name.removesuffix(MIRRORED_SUFFIX) != own]
    nearest = find_nearest(motion, others, PostureMetric.of(robot))
    jerk = np.diff(motion.joint_pos, n=3, axis=0) / robot.control_period**3
    return Quality(
        ground_depth_m=depth,
        slip_m=slip,
        self_collisions=int(count_episodes(overlap > DEEP, apart)),
        jerk_rad_s3=float(np.sqrt(np.mean(jerk**2))),
        landings=int(landed),
        captured_distance=nearest and nearest[0],
    )


def _find_touching(
    data: mujoco.MjData, body: NDArray[Any], on_ground: NDArray[np.bool_], limbs: set[int]
) -> dict[int, Array]:
    """Find where hands and feet touch the ground, in their own frames, (K, 3) each."""
    touching: dict[int, list[Array]] = {}
    for contact, pair in zip(np.flatnonzero(on_ground), body[on_ground], strict=True):
        limb = int(pair.max())
        if limb in limbs:
            apart = data.contact.pos[contact] - data.xpos[limb]
            touching.setdefault(limb, []).append(data.xmat[limb].reshape(3, 3).T @ apart)
    return {
        limb: np.concatenate([np.array(points), _to_world(data, limb, np.array(points))], axis=1)
        for limb, points in touching.items()
    }


def _measure_slip(data: mujoco.MjData, before: dict[int, Array]) -> float:
    """Measure how far the points that touched have slid since; a limb that rolls slides nowhere."""
    slip = 0.0
    for limb, points in before.items():
        moved = _to_world(data, limb, points[:, :3]) - points[:, 3:]
        slip += float(np.linalg.norm(moved[:, :2], axis=1).min())
    return slip


def _to_world(data: mujoco.MjData, body: int, points: Array) -> Array:
    return data.xpos[body] + points @ data.xmat[body].reshape(3, 3).T


def rise(strategy: PlannedRise, fall: Fall, seed: list[int]) -> dict[str, Any]:
    """Plan a rise, measure its motion, and play it; an unfiltered one without a preflight."""
    world = strategy.world
    plan = strategy.plan(fall.posture, np.random.default_rng(seed))
    record: dict[str, Any] = {"start_class": fall.start_class, "stood": False}
    if plan.motion is None:
        return record
    judged = preflight(world, plan.motion, voltage=VOLTAGE, start=fall.posture)
    record |= asdict(measure_quality(world, plan.motion, list_captured(strategy.database)))
    record["saturation_s"] = float(judged.figures.saturation.max())
    options = SessionOptions(preflight=strategy.settings.filtering)
    rng, twin = np.random.default_rng(seed), Twin(world, fall.posture)
    played = get_up(twin, strategy, seed=rng, max_attempts=1, options=options)
    record |= {"stood": played.stood, "reason": played.reason}
    return record | (measure_way(played.outcome) if played.outcome else {})


def measure_way(outcome: Outcome) -> dict[str, Any]:
    """Measure the way of a rise that was played: the figures of naturalness that reports have."""
    return {
        "stand_time_s": float(outcome.stand_time),
        "detour_rad": float(outcome.detour),
        "height_lost": float(outcome.height_lost),
    }


def list_captured(database: MotionDatabase) -> list[Motion]:
    """List the rises that were captured from people."""
    return [motion for motion in database.rising if motion.strategy == CAPTURED]


def play_captured(world: World, captured: Sequence[Motion]) -> list[dict[str, Any]]:
    """Play captured rises from their own starts."""
    rows: list[dict[str, Any]] = []
    for motion in captured:
        start = Scenarios.nominal(world, place(world.robot, world.model, motion.posture(0)))
        length = len(motion.time) + round(HOLD / world.robot.control_period)
        record = play(world, start, hold_last(motion.joint_target, length)[None])
        outcome = Outcome(record, world.robot).take(0)
        row = asdict(measure_quality(world, motion, captured)) | measure_way(outcome)
        rows.append(row | {"start_class": motion.start_class, "stood": bool(outcome.stood)})
    return rows


def summarize_rises(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Count the stands, and summarize the figures of the motions."""
    stood = sum(row["stood"] for row in rows)
    made = [row for row in rows if "slip_m" in row]
    figures = {"n": len(rows), "stood": stood, "stood_95": wilson_interval(stood, len(rows))}
    names = ("ground_depth_m", "slip_m", "jerk_rad_s3", "landings", "captured_distance")
    way = ("stand_time_s", "detour_rad", "height_lost")
    figures |= {name: _summarize(made, name) for name in names}
    figures |= {name: _summarize([row for row in made if row["stood"]], name) for name in way}
    return figures | {"self_collisions": sum(row["self_collisions"] for row in made)}


def _summarize(rows: list[dict[str, Any]], name: str) -> Any:
    return summarize(row[name] for row in rows if row.get(name) is not None)


def main(n: int = 20, seed: int = 0, robot: str = "op3", json: Path | None = None) -> None:
    """Rise from n falls of each class by the whole method and by either half."""
    if n < 1:
        raise SystemExit(f"--n is {n}, expected 1 or more")
    world = World(load_robot(robot))
    falls = sample_falls(world, dict.fromkeys(BENCH_CLASSES, n), np.random.default_rng(seed))
    halves = {
        "whole": PlannedRise(world),
        "no filtering": PlannedRise(world, settings=PlannerSettings(filtering=False)),
        "no planning": PlannedRise(world, settings=PlannerSettings(planning=False)),
    }
    rises: dict[str, list[dict[str, Any]]] = {}
    with counting("rises", len(falls) * len(halves)) as advance:
        for name, strategy in halves.items():
            rises[name] = []
            for number, fall in enumerate(falls):
                rises[name].append(rise(strategy, fall, [seed, 1, number]))
                advance(1)
    captured = list_captured(halves["whole"].database)
    if captured:
        rises["captured"] = play_captured(world, captured)
    cases = {name: summarize_rises(rows) for name, rows in rises.items()}
    table = make_table(("figure", *cases), left=("figure",))
    for figure in cases["whole"]:
        table.add_row(figure, *(format_figure(case[figure]) for case in cases.values()))
    Console().print(table)
    if json is not None:
        record = {
            "name": "planning_or_filtering",
            "robot": robot,
            "seed": seed,
            "cases": cases,
            "rises": rises,
        }
        write_atomically(json, to_json(record))


if __name__ == "__main__":
    tyro.cli(main)
