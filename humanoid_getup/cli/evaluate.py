"""`getup eval POLICY`: how often, how fast and how hard a policy gets up."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

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
from humanoid_getup.scenes.named_scenes import load_grounds
from humanoid_getup.simulation.falls import CLASSES, FallSet, FallSetError, sample_fall_set
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.styled_rise import PLANNED, read_curves
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.extraction import ExtractionError
from humanoid_getup.style.style_file import load_any_style, load_style

if TYPE_CHECKING:  # torch is slow to import
    from sim2real.policy_evaluation import PolicyRollouts, StyleChoice

FIGURES = ("n", "stood", "stood_interval_95", "stand_time_s", "rms_torque_nm", "head_impact_m_s")
STYLE_FIGURES = ("height_error", "angle_error_deg")
NEAREST = "nearest"
"""Style of a policy that gets none: it is chosen among all named ones."""


def evaluate(command: Evaluate) -> int:
    """Sample falls in each scene, let the policy get up from each in each style, judge."""
    names = command.scene.split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"--scene is {command.scene}, expected each scene once")
    if len(names) > 1 and command.falls is not None:
        raise BadInputError(f"--falls is {command.falls}, expected one --scene with it")
    worlds = [load_world(replace(command, scene=name)) for name in names]
    robot = worlds[0].robot
    limit = make_torque_limit(command, robot)
    policy = load_policy(robot, command.policy, limit.value)
    _check_physics(command, policy)
    styles = _list_styles(command, policy)
    style = policy.contract.style
    if command.height_map and not (style and style.height_map):
        raise BadInputError(
            f"--height-map is given, expected none: policy '{command.policy}' has no height map"
        )
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
    for first in worlds:
        grounds = _list_grounds(command, first)
        falls = [fall for _, fall_set in grounds for fall in fall_set.falls]
        for name in styles:
            label = ", ".join([first.scene.name, *([name] if name else [])])
            choices, planned = _choose_curves(policy, grounds, name, command.seed)
            rollouts: list[PolicyRollouts] = []
            with counting(f"rises ({label})", len(falls)) as count:
                for number, (world, fall_set) in enumerate(grounds):
                    rollouts += evaluate_policy(
                        robot,
                        policy.action,
                        policy.act,
                        [fall.posture for fall in fall_set.falls],
                        perturbation,
                        command.seed * len(grounds) + number,
                        scene=world.scene,
                        style=style,
                        choose_style=choices[number],
                        sees_ground=command.height_map,
                        report=count,
                    )
            cases[label] = {
                "scene": first.scene.name,
                "style": name,
                "falls_seed": grounds[0][1].seed,
                "grounds": len(grounds),
                **planned,
                **summarize_rollouts(falls, rollouts, CLASSES),
            }
    figures = {
        "name": "eval",
        "policy": find_policy(robot, command.policy).stem,
        "seed": command.seed,
        "n": command.n,
        "robot": robot.name,
        "limit_by": limit.by,
        "trial": perturbation.label,
        "height_map": command.height_map,
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


def _choose_curves(
    policy: OnnxPolicy, grounds: list[tuple[World, FallSet]], style: str | None, seed: int
) -> tuple[list[StyleChoice | None], dict[str, int]]:
    """Make what chooses the curves of each rise, for each ground; count rises with a plan's own."""
    if style is None:
        return [None] * len(grounds), {}
    robot = policy.robot
    if style == PLANNED:
        plans: list[list[StyleCurves | None]] = []
        with counting("plans", sum(len(falls.falls) for _, falls in grounds)) as count:
            for world, falls in grounds:
                plans.append(_plan_curves(world, falls, seed, count))
        nearest = load_any_style(robot)

        def follow_plans(curves: list[StyleCurves | None]) -> StyleChoice:
            return lambda row, features: curves[row] or nearest.choose(features)

        found = sum(curves is not None for ground in plans for curves in ground)
        return [follow_plans(curves) for curves in plans], {"planned": found}
    with refusing():
        given = load_any_style(robot) if style == NEAREST else load_style(style, robot)
    return [lambda _row, features: given.choose(features)] * len(grounds), {}


def _plan_curves(
    world: World, falls: FallSet, seed: int, count: Callable[[float], None]
) -> list[StyleCurves | None]:
    """Plan a motion for each fall, and read its curves; ``None`` where no plan stands."""
    planner = PlannedRise(world)
    found: list[StyleCurves | None] = []
    for number, fall in enumerate(falls.falls):
        plan = planner.plan(fall.posture, np.random.default_rng([seed, number]))
        found.append(None)
        if isinstance(plan, MotionPlan) and plan.motion.rises:
            with suppress(ExtractionError):
                found[-1] = read_curves(world, plan.motion)
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


def _list_grounds(command: Evaluate, world: World) -> list[tuple[World, FallSet]]:
    """List the falls of a scene; where a seed makes the ground, every four on one of their own."""
    name, robot = world.scene.name, world.robot
    grounds = load_grounds(name, robot, command.n // len(CLASSES), command.seed)
    if command.falls is not None or len(grounds) == 1:
        return [(world, _find_falls(command, world))]
    found: list[tuple[World, FallSet]] = []
    with counting(f"falls ({name})", command.n) as count, refusing():
        for scene, seed in grounds:
            own = World(robot, scene)
            found.append((own, sample_fall_set(own, dict.fromkeys(CLASSES, 1), seed)))
            count(len(CLASSES))
    return found


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
