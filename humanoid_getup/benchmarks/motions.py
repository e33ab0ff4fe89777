"""Benchmark of motions: time, load, torque reserve and robustness of each."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from drivers import RunReport, SafetyGuard, Twin
from humanoid_getup.experiments.judge import GroundTruthJudge, RunOutcome
from humanoid_getup.experiments.lying import measure_lying
from humanoid_getup.experiments.play import (
    Rollout,
    RolloutRandomization,
    Trace,
    randomize_rollouts,
)
from humanoid_getup.experiments.standing import is_upright, judge, measure_stance
from humanoid_getup.experiments.starts import settle_posture
from humanoid_getup.experiments.summary import wilson_interval
from humanoid_getup.motions.motion import NO_END, STANDING, Motion
from humanoid_getup.playback.ending import ends_as_meant, hold_time
from humanoid_getup.playback.motion_player import MotionPlayer
from humanoid_getup.playback.play import play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE
from robots.ground import GROUND
from robots.kinematics import read_posture
from robots.quaternion import Array

LIMITS = np.array([4.1, 3.5, 3.0, 2.5, 2.2, 2.0, 1.8, 1.6, 1.5, 1.4, 1.3, 1.2, 1.1, 1.0])
"""Torque limits on servos with the first as their stall torque [N·m]; others get the same
shares."""


def bench_motions(
    world: World,
    motions: Sequence[Motion],
    *,
    seed: int,
    each: int = 50,
    report: Callable[[dict[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Play each motion undisturbed, under falling torque limits, and ``each`` times disturbed.

    Disturbed: start angles by 3 deg and the root by 5 deg (standard deviations),
    friction 0.4 to 1.2, supply 11.0 to 12.6 V (uniform); through loop and guard on the twin.
    """
    cases = {}
    for number, motion in enumerate(motions):
        record = bench_motion(world, motion, number, seed=seed, each=each)
        cases[motion.name] = record
        report({"motion": motion.name, **record})
    return {"name": "motions", "seed": seed, "n": each, "robot": world.robot.name, "cases": cases}


def bench_motion(
    world: World, motion: Motion, number: int, *, seed: int, each: int
) -> dict[str, Any]:
    """Play one of several motions, by its number, as `bench_motions` does; return its record."""
    start = settle_posture(world, motion.posture(0))
    record = _play_once(world, motion, start)
    record["lowest_torque_limit_nm"] = find_lowest_limit(world, motion, start)
    rng = np.random.default_rng([seed, number])
    succeeded = sum(_play_disturbed(world, motion, start, each, rng))
    return record | {
        "disturbed_n": each,
        "disturbed_succeeded": succeeded,
        "disturbed_interval_95": wilson_interval(succeeded, each),
    }


def _play_once(world: World, motion: Motion, start: Array) -> dict[str, Any]:
    robot = world.robot
    twin = Twin(world)
    twin.place(read_posture(robot, world.model, start))
    run, outcome = _play(twin, world, motion)
    return {
        "start_class": motion.start_class,
        "end_class": motion.end_class,
        "strategy": motion.strategy,
        "succeeded": ends_as_meant(world, motion, outcome),
        "stand_time_s": outcome.stand.start_time,
        "head_impact_m_s": outcome.head_impact,
        "torso_impact_m_s": outcome.torso_impact,
        "peak_torque_nm": outcome.peak_torque,
        "rms_torque_nm": outcome.rms_torque,
        "peak_velocity_rad_s": outcome.peak_velocity,
        "self_collisions": outcome.self_collisions,
        "limit_violations": outcome.limit_violations,
        "clips": run.clips.total,
    }


def find_lowest_limit(world: World, motion: Motion, start: Array) -> float | None:
    """Find the lowest torque limit [N·m] such that the motion succeeds under it and all above.

    The limits are `LIMITS`, as shares of the servos' own stall torque.
    """
    limits = LIMITS * (world.robot.max_torque.max() / LIMITS[0])
    n, period = len(limits), world.robot.control_period
    hold = round(hold_time(motion) / period)
    targets = motion.sample(np.arange(motion.time[0], motion.time[-1] + 0.5 * period, period))
    targets = np.concatenate([targets, np.repeat(targets[-1:], hold, axis=0)])
    parameters = DomainParameters.nominal(world, n, torque_limit=limits)
    trace = Rollout(world, n).play(np.tile(start, (n, 1)), np.tile(targets, (n, 1, 1)), parameters)
    unbroken = np.cumprod(_judge_rollouts(world, motion, trace)).astype(bool)
    return float(limits[unbroken][-1]) if unbroken.any() else None


def _judge_rollouts(world: World, motion: Motion, trace: Trace) -> np.ndarray:
    """Return which rollouts of a motion end as it should, (N,)."""
    if motion.end_class == NO_END:
        return np.ones(len(trace.diverged), dtype=bool)
    if motion.end_class != STANDING:
        return measure_lying(world, trace, motion.end_class).lies
    upright = is_upright(measure_stance(world, trace), world.robot)
    return np.array([judge(u, trace.period).stood for u in upright])


def _play_disturbed(
    world: World, motion: Motion, start: Array, plays: int, rng: np.random.Generator
) -> list[bool]:
    robot = world.robot
    starts, parameters = randomize_rollouts(
        world, start, plays + 1, RolloutRandomization(), FULL_TORQUE, rng
    )
    succeeded = []
    for i in range(1, plays + 1):  # the first is the undisturbed one
        model = copy.copy(world.model)
        model.geom_friction[model.geom(GROUND).id, 0] = parameters.friction[i]
        twin = Twin(World(robot, world.scene, model=model), voltage=float(parameters.voltage[i]))
        twin.place(read_posture(robot, model, starts[i]))
        succeeded.append(ends_as_meant(world, motion, _play(twin, world, motion)[1]))
    return succeeded


def _play(twin: Twin, world: World, motion: Motion) -> tuple[RunReport, RunOutcome]:
    """Play a motion without monitors, which would end a failing one early."""
    player = MotionPlayer(twin.robot, motion, hold=hold_time(motion))
    judge = GroundTruthJudge(twin.simulation, None, world.scene)
    return play(player, SafetyGuard(twin), judge)
