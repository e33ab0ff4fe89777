"""`getup eval POLICY`: how often, how fast and how hard a policy gets up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
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
from humanoid_getup.strategies.plan import MotionPlan
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.styled_rise import PLANNED, read_curves
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style_file import load_any_style, load_style
from robots.quaternion import Array

FIGURES = ("n", "stood", "stood_interval_95", "stand_time_s", "rms_torque_nm", "head_impact_m_s")
STYLE_FIGURES = ("height_error", "angle_error_deg")
NEAREST = "nearest"
"""Style of a policy that gets none: of all named ones, that which begins nearest."""


def evaluate(command: Evaluate) -> int:
    """Sample falls in each scene, let the policy get up from each in each style, judge."""
    names = command.scene.split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"--scene is {command.scene}, expected each scene once")
    if len(names) > 1 and command.falls is not None:
        raise BadInputError(f"--falls is {command.falls}, expected one --scene with it")
    worlds = [load_world(replace(command, scene=name)) for name in names]
    limit = make_torque_limit(command, worlds[0].robot)
    policy = load_policy(worlds[0].robot, command.policy, limit.value)
    _check_physics(command, policy)
    styles = _list_styles(command, policy)
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
    cases: dict[str, dict[str, Any]] = {}
    for world in worlds:
        fall_set = _find_falls(command, world)
        starts = [fall.posture for fall in fall_set.falls]
        for style in styles:
            choose = _make_choice(policy, world, style, fall_set, command.seed)
            label = ", ".join([world.scene.name, *([style] if style else [])])
            with counting(f"rises ({label})", len(starts)) as count:
                rollouts = evaluate_policy(
                    policy.robot,
                    policy.action,
                    policy.act,
                    starts,
                    perturbation,
                    command.seed,
                    scene=world.scene,
                    style=policy.contract.style,
                    choose_style=choose,
                    report=count,
                )
            cases[label] = {
                "scene": world.scene.name,
                "style": style,
                "falls_seed": fall_set.seed,
                **summarize_rollouts(fall_set.falls, rollouts, CLASSES),
            }
    figures = {
        "name": "eval",
        "policy": find_policy(worlds[0].robot, command.policy).stem,
        "seed": command.seed,
        "n": command.n,
        "robot": worlds[0].robot.name,
        "limit_by": limit.by,
        "trial": perturbation.label,
        "cases": cases,
    }
    write_json(to_json(figures), command.json)
    console = console_for(command.json)
    for label, case in cases.items():
        console.print(_tabulate(f"{figures['policy']}, {label}: {figures['trial']}", case))
    return DID_IT


def _list_styles(command: Evaluate, policy: OnnxPolicy) -> list[str | None]:
    """List the styles to follow; one ``None`` for a policy without style curves."""
    if policy.contract.style is None:
        if command.style is not None:
            raise BadInputError(
                f"--style is {command.style}, expected none: policy '{command.policy}' follows no "
                "style curves"
            )
        return [None]
    return list((command.style or NEAREST).split(","))


def _make_choice(
    policy: OnnxPolicy, world: World, style: str | None, falls: FallSet, seed: int
) -> Callable[[int, Array], StyleCurves] | None:
    """Make what chooses the curves of each rise by its number and the features at its start."""
    if style is None:
        return None
    if style == PLANNED:
        curves = _plan_curves(world, falls, seed)
        nearest = load_any_style(policy.robot)
        return lambda row, features: curves[row] or nearest.choose(features)
    with refusing():
        robot = policy.robot
        given = load_any_style(robot) if style == NEAREST else load_style(style, robot)
    return lambda _row, features: given.choose(features)


def _plan_curves(world: World, falls: FallSet, seed: int) -> list[StyleCurves | None]:
    """Plan a motion for each fall, and read its curves; ``None`` where no plan stands."""
    planner = PlannedRise(world)
    found: list[StyleCurves | None] = []
    with counting("plans", len(falls.falls)) as count:
        for number, fall in enumerate(falls.falls):
            plan = planner.plan(fall.posture, np.random.default_rng([seed, number]))
            found.append(None)
            if isinstance(plan, MotionPlan) and plan.motion.rises:
                found[-1] = read_curves(world.robot, plan.motion)
            count(1)
    return found


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


def _tabulate(title: str, figures: dict[str, Any]) -> Table:
    names = FIGURES + (STYLE_FIGURES if figures["style"] else ())
    table = Table(title, *names, box=None)
    for name, row in (*figures["classes"].items(), ("all", figures["all"])):
        table.add_row(name, *(format_figure(row[figure]) for figure in names))
    return table
