"""`getup eval POLICY`: how often, how fast and how hard a policy gets up."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_world, make_torque_limit
from humanoid_getup.cli.options.policies import Evaluate
from humanoid_getup.cli.output import (
    console_for,
    counting,
    format_figure,
    phase,
    to_json,
    write_json,
)
from humanoid_getup.cli.policies import load_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.simulation.falls import CLASSES, FallSet, FallSetError, sample_fall_set
from humanoid_getup.simulation.world import World

FIGURES = ("n", "stood", "stood_interval_95", "stand_time_s", "rms_torque_nm", "head_impact_m_s")


def evaluate(command: Evaluate) -> int:
    """Sample falls, let the policy get up from each, judge."""
    world = load_world(command)
    limit = make_torque_limit(command, world.robot)
    policy = load_policy(world.robot, command.policy, limit.value)
    _check_physics(command, policy)
    with phase("loading"):
        from sim2real.perturbations import Perturbation, evaluate_policy, summarize_rollouts
    perturbation = Perturbation(
        torque_limit=limit.value,
        limit_by=command.limit_by,
        delay=command.delay / 1000.0,
        voltage=command.voltage,
        friction=command.friction,
        mass=command.mass,
        backlash=math.radians(command.backlash),
        weak_servo=command.weak_servo,
        push=command.push,
        imu_tilt=math.radians(command.imu_tilt),
        gyro_bias=math.radians(command.gyro_bias),
        noise=command.noise,
        physics=command.physics,
    )
    fall_set = _find_falls(command, world)
    with counting("rises", len(fall_set.falls)) as count:
        rollouts = evaluate_policy(
            policy.robot,
            policy.action,
            policy.act,
            [fall.posture for fall in fall_set.falls],
            perturbation,
            command.seed,
            scene=command.scene,
            report=count,
        )
    figures = {
        "name": "eval",
        "policy": find_policy(world.robot, command.policy).stem,
        "seed": command.seed,
        "n": command.n,
        "robot": world.robot.name,
        "scene": command.scene,
        "falls_seed": fall_set.seed,
        "falls_scene": fall_set.scene,
        "limit_by": limit.by,
        "trial": perturbation.label,
        **summarize_rollouts(fall_set.falls, rollouts, CLASSES),
    }
    write_json(to_json(figures), command.json)
    console_for(command.json).print(_tabulate(figures))
    return DID_IT


def _check_physics(command: Evaluate, policy: OnnxPolicy) -> None:
    """Refuse limits of servos that are position actuators without a motor model."""
    has_limits = command.torque_limit or command.voltage or command.weak_servo < 1.0
    if command.physics == "menagerie servos" and (has_limits or policy.action.pwm_limit < 1.0):
        raise BadInputError(
            f"--physics is '{command.physics}', expected without torque limit, voltage, weak "
            "servo and a policy's own limit of the supply: its servos are not motors"
        )


def _find_falls(command: Evaluate, world: World) -> FallSet:
    """Read the falls from their file, or sample them."""
    each = command.n // len(CLASSES)
    with phase("sampling falls"), refusing():
        if command.falls is not None and command.falls.exists():
            falls = FallSet.load(command.falls, world.robot)
            if falls.scene != world.scene.name:
                raise FallSetError(
                    command.falls, f"they are of scene '{falls.scene}', not '{world.scene.name}'"
                )
            return falls.choose(each)
        falls = sample_fall_set(world, dict.fromkeys(CLASSES, each), command.seed)
        if command.falls is not None:
            falls.save(command.falls)
    return falls


def _tabulate(figures: dict[str, Any]) -> Table:
    table = Table(f"{figures['policy']}: {figures['trial']}", *FIGURES, box=None)
    for name, row in (*figures["classes"].items(), ("all", figures["all"])):
        table.add_row(name, *(format_figure(row[figure]) for figure in FIGURES))
    return table
