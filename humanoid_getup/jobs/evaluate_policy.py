"""Evaluates a policy: success, time and load of its rises from settled falls."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from humanoid_getup.experiments.judging.summary import PolicyClasses, PolicySummary
from humanoid_getup.experiments.starts.falls import CLASSES, FallSet, FallSetError, sample_fall_set
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_world, make_torque_limit
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.learning import EvaluateRequest
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.policy.style_follower import StyleChoice
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
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
    from sim2real.perturbations import Perturbation

NEAREST = "nearest"
"""Style without a choice: the nearest of all named ones."""
Grounds = list[tuple[World, FallSet]]
"""Each with the falls on it."""


class EvaluatedCase(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of a policy in a scene and a style."""

    scene: str
    style: str | None
    falls_seed: int
    grounds: int
    """Number of grounds of the falls."""
    planned: int | UnsetType = UNSET
    """Number of rises that follow the curves of a plan."""
    classes: dict[str, PolicySummary]
    all: PolicySummary


class Evaluation(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of a policy, by scene and style."""

    name: str = "eval"
    policy: str
    seed: int
    n: int
    """Falls in each scene."""
    robot: str
    limit_by: str | None
    trial: str
    """What differs from nominal."""
    height_map: bool
    cases: dict[str, EvaluatedCase]
    """Cases by scene and style."""


def evaluate(
    request: EvaluateRequest, report: Report | None = None, cancel: Cancel | None = None
) -> Evaluation:
    """Sample falls in each scene, let the policy get up from each in each style, judge.

    Raises:
        BadInputError: if the policy, a scene, a style or falls cannot be used.
        CancelledError: if ``cancel`` ended it.
    """
    EvaluateRequest.accept(request)
    request, monitor = name_robot(request, request.policy), ProgressMonitor(report, cancel)
    names = _find_scenes(request)
    monitor.begin("loading")
    worlds = [load_world(replace(request, scene=name)) for name in names]
    robot = worlds[0].robot
    limit = make_torque_limit(request, robot)
    policy = load_policy(robot, request.policy, limit.value)
    _check_variant(request, policy)
    styles = _load_styles(request, policy)
    _check_height_map(request, policy)
    perturbation = _make_perturbation(request, limit.value)
    cases: dict[str, EvaluatedCase] = {}
    for first in worlds:
        grounds = _list_grounds(request, first, monitor)
        for name, given in styles.items():
            label = ", ".join([first.scene.name, *([name] if name else [])])
            choices, planned = _choose_curves(grounds, name, given, request.seed, monitor)
            found = _roll_out(request, policy, perturbation, grounds, choices, label, monitor)
            cases[label] = EvaluatedCase(
                scene=first.scene.name,
                style=name,
                falls_seed=grounds[0][1].seed,
                grounds=len(grounds),
                planned=planned,
                classes=found.classes,
                all=found.all,
            )
    return Evaluation(
        policy=find_policy(robot, request.policy).stem,
        seed=request.seed,
        n=request.n,
        robot=robot.name,
        limit_by=limit.by,
        trial=perturbation.label,
        height_map=request.height_map,
        cases=cases,
    )


def _find_scenes(request: EvaluateRequest) -> list[str]:
    names = request.scene.split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"--scene is {request.scene}, expected each scene once")
    if len(names) > 1 and request.falls is not None:
        raise BadInputError(f"--falls is {request.falls}, expected one --scene with it")
    return names


def _check_height_map(request: EvaluateRequest, policy: OnnxPolicy) -> None:
    style = policy.contract.style
    if request.height_map and not (style and style.height_map):
        raise BadInputError(
            f"--height-map is given, expected none: policy '{request.policy}' has no height map"
        )


def _make_perturbation(request: EvaluateRequest, torque_limit: float | None) -> Perturbation:
    """Make the perturbation of a request."""
    from sim2real.perturbations import Perturbation

    return Perturbation(
        torque_limit=torque_limit,
        limit_by=request.limit_by,
        delay=request.delay / 1000.0,
        voltage=request.voltage,
        friction=request.friction,
        mass=request.mass,
        backlash=math.radians(request.backlash),
        weak_servo=request.weak_servo,
        push=request.push,
        imu_tilt=math.radians(request.imu_tilt),
        gyro_bias=math.radians(request.gyro_bias),
        noise=request.noise,
        physics=request.variant,
    )


def _roll_out(
    request: EvaluateRequest,
    policy: OnnxPolicy,
    perturbation: Perturbation,
    grounds: Grounds,
    choices: list[StyleChoice | None],
    label: str,
    monitor: ProgressMonitor,
) -> PolicyClasses:
    """Let the policy get up from all falls; return the figures."""
    from sim2real.perturbations import PolicyTrial, summarize_rollouts
    from sim2real.policy_evaluation import PolicyDriver, PolicyRollouts

    falls = [fall for _, fall_set in grounds for fall in fall_set.falls]
    rollouts: list[PolicyRollouts] = []
    count = monitor.count(f"rises ({label})", len(falls))
    for number, (world, fall_set) in enumerate(grounds):
        driver = PolicyDriver.of(policy, choices[number], sees_ground=request.height_map)
        trial = PolicyTrial(
            robot=world.robot,
            policy=driver,
            perturbation=perturbation,
            seed=request.seed * len(grounds) + number,
            scene=world.scene,
        )
        rollouts.append(trial.run([fall.posture for fall in fall_set.falls], count))
    return summarize_rollouts(falls, PolicyRollouts.join(rollouts), CLASSES)


def _load_styles(request: EvaluateRequest, policy: OnnxPolicy) -> dict[str | None, Style | None]:
    """Load the styles to follow by name; one without a name for a policy without style curves.

    That of plans is ``None``: each fall has its own.
    """
    if policy.contract.style is None:
        if request.style is not None:
            raise BadInputError(
                f"--style is {request.style}, expected none: policy '{request.policy}' follows no "
                "style curves"
            )
        return {None: None}
    names = (NEAREST if request.style is None else request.style).split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"--style is {request.style}, expected each style once")
    with refusing():
        return {name: _load_style(name, policy.robot) for name in names}


def _load_style(name: str, robot: Robot) -> Style | None:
    if name == PLANNED:
        return None
    return load_any_style(robot) if name == NEAREST else load_style(name, robot)


def _choose_curves(
    grounds: Grounds, name: str | None, style: Style | None, seed: int, monitor: ProgressMonitor
) -> tuple[list[StyleChoice | None], int | UnsetType]:
    """Make the choice of curves for each ground; count rises that follow a plan's curves."""
    if name is None:
        return [None] * len(grounds), UNSET
    if style is None:
        plans: list[list[StyleCurves | None]] = []
        count = monitor.count("plans", sum(len(falls.falls) for _, falls in grounds))
        for world, falls in grounds:
            plans.append(_plan_curves(world, falls, seed, count))
        nearest = load_any_style(grounds[0][0].robot)

        def follow_plans(curves: list[StyleCurves | None]) -> StyleChoice:
            return lambda row, features: curves[row] or nearest.choose(features)

        found = sum(curves is not None for ground in plans for curves in ground)
        return [follow_plans(curves) for curves in plans], found
    return [lambda _row, features: style.choose(features)] * len(grounds), UNSET


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


def _check_variant(request: EvaluateRequest, policy: OnnxPolicy) -> None:
    """Refuse a part of the gains, and limits of servos that have no motor model."""
    if policy.action.gain_share:
        raise BadInputError(
            f"policy '{request.policy}' has a part of the servos' position gain, expected all of "
            "it: `getup run` plays it"
        )
    has_limits = request.torque_limit or request.voltage or request.weak_servo < 1.0
    if request.variant == "menagerie servos" and (has_limits or policy.action.pwm_limit < 1.0):
        raise BadInputError(
            f"--variant is '{request.variant}', expected without torque limit, voltage, weak "
            "servo and a policy's own limit of the supply: its servos are not motors"
        )


def _list_grounds(request: EvaluateRequest, world: World, monitor: ProgressMonitor) -> Grounds:
    """List the falls of a scene; on random ground every four have a ground of their own."""
    name, robot = world.scene.name, world.robot
    grounds = load_grounds(name, robot, request.n // len(CLASSES), request.seed)
    if request.falls is not None or len(grounds) == 1:
        return [(world, _find_falls(request, world, monitor))]
    found: Grounds = []
    count = monitor.count(f"falls ({name})", request.n)
    with refusing():
        for scene, seed in grounds:
            own = World(robot, scene)
            found.append((own, sample_fall_set(own, dict.fromkeys(CLASSES, 1), seed)))
            count(len(CLASSES))
    return found


def _find_falls(request: EvaluateRequest, world: World, monitor: ProgressMonitor) -> FallSet:
    """Read the falls from their file, or sample them."""
    each = request.n // len(CLASSES)
    with refusing():
        if request.falls is not None and request.falls.exists():
            falls = FallSet.load(request.falls, world.robot)
            if falls.scene != world.scene.name:
                raise FallSetError(
                    request.falls, f"they are of scene '{falls.scene}', not '{world.scene.name}'"
                )
            return falls.choose(each)
        count = monitor.count(f"falls ({world.scene.name})", request.n)
        falls = sample_fall_set(world, dict.fromkeys(CLASSES, each), request.seed, count)
        if request.falls is not None:
            falls.save(request.falls)
    return falls
