"""`getup eval POLICY`: how often, how fast and how hard a policy gets up."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_world, make_torque_limit
from humanoid_getup.cli.options.policies import Evaluate
from humanoid_getup.cli.output import (
    console_for,
    counting,
    phase,
    to_json,
    write_json,
)
from humanoid_getup.cli.policies import load_policy, name_robot
from humanoid_getup.experiments.starts import CLASSES, FallSet, FallSetError, sample_fall_set
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.scenes.named_scenes import load_grounds
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.styled_rise import PLANNED, read_curves
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.extraction import ExtractionError
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import load_any_style, load_style
from robots import Robot

if TYPE_CHECKING:  # torch is slow to import
    from sim2real.policy_evaluation import PolicyRollouts, StyleChoice

COLUMNS = {
    "to stand [s]": "stand_time_s",
    "RMS [N·m]": "rms_torque_nm",
    "head [m/s]": "head_impact_m_s",
    "height error": "height_error",
    "angle error [deg]": "angle_error_deg",
    "restarts": "restarts",
}
"""Headings of the printed tables, and keys of the JSON."""
FOLLOWED = ("height_error", "angle_error_deg", "restarts")
"""Keys of how a style was followed."""
LEGEND = (
    "median (95th percentile); times and torques are those of rises that stood, all else of all"
)
NEAREST = "nearest"
"""Style of a policy that gets none: it is chosen among all named ones."""


def evaluate(command: Evaluate) -> int:
    """Sample falls in each scene, let the policy get up from each in each style, judge."""
    command = name_robot(command, command.policy)
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
    styles = _load_styles(command, policy)
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
        for name, given in styles.items():
            label = ", ".join([first.scene.name, *([name] if name else [])])
            choices, planned = _choose_curves(grounds, name, given, command.seed)
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
        text = f"{figures['policy']}, {label}; robots {figures['trial']}:\n\n{_tabulate(case)}\n"
        console.print(text, markup=False, soft_wrap=True)
    console.print(LEGEND, soft_wrap=True)
    return DID_IT


def _load_styles(command: Evaluate, policy: OnnxPolicy) -> dict[str | None, Style | None]:
    """Load the styles to follow by name; one without a name for a policy without style curves.

    That of plans is ``None``: each fall has its own.
    """
    if policy.contract.style is None:
        if command.style is not None:
            raise BadInputError(
                f"--style is {command.style}, expected none: policy '{command.policy}' follows no "
                "style curves"
            )
        return {None: None}
    names = (NEAREST if command.style is None else command.style).split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"--style is {command.style}, expected each style once")
    with refusing():
        return {name: _load_style(name, policy.robot) for name in names}


def _load_style(name: str, robot: Robot) -> Style | None:
    if name == PLANNED:
        return None
    return load_any_style(robot) if name == NEAREST else load_style(name, robot)


def _choose_curves(
    grounds: list[tuple[World, FallSet]], name: str | None, style: Style | None, seed: int
) -> tuple[list[StyleChoice | None], dict[str, int]]:
    """Make what chooses the curves of each rise, for each ground; count rises with a plan's own."""
    if name is None:
        return [None] * len(grounds), {}
    if style is None:
        plans: list[list[StyleCurves | None]] = []
        with counting("plans", sum(len(falls.falls) for _, falls in grounds)) as count:
            for world, falls in grounds:
                plans.append(_plan_curves(world, falls, seed, count))
        nearest = load_any_style(grounds[0][0].robot)

        def follow_plans(curves: list[StyleCurves | None]) -> StyleChoice:
            return lambda row, features: curves[row] or nearest.choose(features)

        found = sum(curves is not None for ground in plans for curves in ground)
        return [follow_plans(curves) for curves in plans], {"planned": found}
    return [lambda _row, features: style.choose(features)] * len(grounds), {}


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


def _tabulate(figures: dict[str, Any]) -> str:
    """Write the figures of a case as a Markdown table, by class and over all."""
    columns = {
        heading: key for heading, key in COLUMNS.items() if figures["style"] or key not in FOLLOWED
    }
    rows = [["", "stood", "95 %", *columns]]
    for name, row in (*figures["classes"].items(), ("all", figures["all"])):
        low, high = row["stood_interval_95"]
        interval = f"{100.0 * low:.0f} to {100.0 * high:.0f} %"
        cells = [_format_spread(row[key]) for key in columns.values()]
        rows.append([name, f"{row['stood']} of {row['n']}", interval, *cells])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rule = ["-" * width for width in widths]
    lines = [rows[0], rule, *rows[1:]]
    return "\n".join(
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))} |"
        for line in lines
    )


def _format_spread(spread: dict[str, float | None]) -> str:
    """Write a median and, in parentheses, a 95th percentile; a dash for none."""
    median, p95 = spread["median"], spread["p95"]
    return "-" if median is None or p95 is None else f"{median:.2f} ({p95:.2f})"
