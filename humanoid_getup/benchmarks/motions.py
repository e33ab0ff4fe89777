"""Benchmark of motions: time, load, torque reserve and robustness of each."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from drivers import RunReport, SafetyGuard, Twin
from humanoid_getup.evaluation.judge import GroundTruthJudge, RunOutcome
from humanoid_getup.evaluation.standing import HOLD, HOLD_TIME, is_upright, judge, measure_stance
from humanoid_getup.evaluation.statistics import wilson_interval
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.motion_player import MotionPlayer
from humanoid_getup.playback.play import play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.falls import settle_posture
from humanoid_getup.simulation.rollout import Rollout, RolloutRandomization, randomize_rollouts
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE
from robots.ground import GROUND
from robots.kinematics import read_posture
from robots.quaternion import Array

LIMITS = np.array([4.1, 3.5, 3.0, 2.5, 2.2, 2.0, 1.8, 1.6, 1.5, 1.4, 1.3, 1.2, 1.1, 1.0])  # N·m


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
        start = settle_posture(world, motion.posture(0))
        record = _play_once(world, motion, start)
        record["lowest_torque_limit_nm"] = find_lowest_limit(world, motion, start)
        rng = np.random.default_rng([seed, number])
        stood = sum(_play_disturbed(world, motion, start, each, rng))
        record |= {
            "disturbed_n": each,
            "disturbed_stood": stood,
            "disturbed_interval_95": wilson_interval(stood, each),
        }
        cases[motion.name] = record
        report({"motion": motion.name, **record})
    return {"name": "motions", "seed": seed, "n": each, "robot": world.robot.name, "cases": cases}


def _play_once(world: World, motion: Motion, start: Array) -> dict[str, Any]:
    robot = world.robot
    twin = Twin(world)
    twin.place(read_posture(robot, world.model, start))
    run, outcome = _play(twin, motion)
    return {
        "start_class": motion.start_class,
        "strategy": motion.strategy,
        "stood": outcome.stand.stood,
        "stand_time_s": outcome.stand.start_time,
        "peak_torque_nm": outcome.peak_torque,
        "rms_torque_nm": outcome.rms_torque,
        "peak_velocity_rad_s": outcome.peak_velocity,
        "self_collisions": outcome.self_collisions,
        "limit_violations": outcome.limit_violations,
        "clips": run.clips.total,
    }


def find_lowest_limit(world: World, motion: Motion, start: Array) -> float | None:
    """Find the lowest of `LIMITS` [N·m] such that the motion stands under it and all above."""
    robot, period = world.robot, world.robot.control_period
    n, hold = len(LIMITS), round((HOLD_TIME + 0.3) / period)
    targets = motion.sample(np.arange(motion.time[0], motion.time[-1] + 0.5 * period, period))
    targets = np.concatenate([targets, np.repeat(targets[-1:], hold, axis=0)])
    parameters = DomainParameters.nominal(world, n, torque_limit=LIMITS)
    trace = Rollout(world, n).play(np.tile(start, (n, 1)), np.tile(targets, (n, 1, 1)), parameters)
    upright = is_upright(measure_stance(world, trace), robot)
    stood = np.array([judge(u, period).stood for u in upright])
    unbroken = np.cumprod(stood).astype(bool)
    return float(LIMITS[unbroken][-1]) if unbroken.any() else None


def _play_disturbed(
    world: World, motion: Motion, start: Array, plays: int, rng: np.random.Generator
) -> list[bool]:
    robot = world.robot
    starts, parameters = randomize_rollouts(
        world, start, plays + 1, RolloutRandomization(), FULL_TORQUE, rng
    )
    stood = []
    for i in range(1, plays + 1):  # the first is the undisturbed one
        model = copy.copy(world.model)
        model.geom_friction[model.geom(GROUND).id, 0] = parameters.friction[i]
        twin = Twin(World(robot, world.scene, model=model), voltage=float(parameters.voltage[i]))
        twin.place(read_posture(robot, model, starts[i]))
        stood.append(_play(twin, motion)[1].stand.stood)
    return stood


def _play(twin: Twin, motion: Motion) -> tuple[RunReport, RunOutcome]:
    """Play a motion without monitors, which would end a failing one early."""
    player = MotionPlayer(twin.robot, motion, hold=HOLD)
    return play(player, SafetyGuard(twin), GroundTruthJudge(twin.simulation, None))
