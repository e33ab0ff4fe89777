"""Evaluates a policy: success, time and load of its rises from settled falls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import msgspec
from msgspec import UNSET, UnsetType

from humanoid_getup.experiments.judging.summary import PolicySummary
from humanoid_getup.experiments.starts.falls import CLASSES, FallSet, FallSetError, sample_fall_set
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_world
from humanoid_getup.jobs.pieces.policy_rollouts import (
    NEAREST,
    EvaluatedPolicy,
    Grounds,
    Rollouts,
    SeededScene,
    cut_falls,
    load_followed,
)
from humanoid_getup.jobs.pieces.spreading import starting
from humanoid_getup.jobs.policies import name_robot
from humanoid_getup.jobs.requests.learning import EvaluateRequest
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.scenes.named_scenes import is_random, seed_grounds
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.styled_rise import PLANNED


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
        EngineError: if the engine does not answer, or loses workers.
    """
    EvaluateRequest.accept(request)
    request, monitor = name_robot(request, request.policy), ProgressMonitor(report, cancel)
    names = _find_scenes(request)
    monitor.begin("loading")
    worlds = {name: load_world(replace(request, scene=name)) for name in names}
    evaluated = EvaluatedPolicy(request)
    _check_variant(request, evaluated.policy)
    styles = _find_styles(request, evaluated.policy)
    _check_height_map(request, evaluated.policy)
    cases: dict[str, EvaluatedCase] = {}
    with refusing(), starting(request, _count_pieces(request, names, styles)) as executor:
        rollouts = Rollouts(evaluated=evaluated, executor=executor, monitor=monitor)
        for name, world in worlds.items():
            grounds = _list_grounds(request, name, world, rollouts)
            for style in styles:
                label = ", ".join([world.scene.name, *([style] if style else [])])
                cases[label] = _evaluate_case(request, grounds, style, label, rollouts)
    return Evaluation(
        policy=find_policy(evaluated.robot, request.policy).stem,
        seed=request.seed,
        n=request.n,
        robot=evaluated.robot.name,
        limit_by=evaluated.limit.by,
        trial=evaluated.perturbation.label,
        height_map=request.height_map,
        cases=cases,
    )


def _evaluate_case(
    request: EvaluateRequest, grounds: Grounds, style: str | None, label: str, rollouts: Rollouts
) -> EvaluatedCase:
    """Let the policy get up from all falls in a scene, in a style."""
    from sim2real.perturbations import CHUNK, summarize_rollouts
    from sim2real.policy_evaluation import join_rollouts

    pieces = cut_falls(grounds, style, most=CHUNK, seed=request.seed)
    found = rollouts.roll_out(pieces, f"rises ({label})")
    falls = [fall for _, fall_set in grounds for fall in fall_set.falls]
    figures = summarize_rollouts(falls, join_rollouts([each.figures for each in found]), CLASSES)
    planned = sum(each.planned for each in found)
    return EvaluatedCase(
        scene=grounds[0][1].scene,
        style=style,
        falls_seed=grounds[0][1].seed,
        grounds=len(grounds),
        planned=planned if style == PLANNED else UNSET,
        classes=figures.classes,
        all=figures.all,
    )


def _count_pieces(
    request: EvaluateRequest, names: Sequence[str], styles: Sequence[str | None]
) -> int:
    """Count the pieces of all rollouts."""
    from sim2real.perturbations import CHUNK

    each = request.n // len(CLASSES)
    random = [is_random(name) and request.falls is None for name in names]
    return len(styles) * sum(each if its else math.ceil(request.n / CHUNK) for its in random)


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


def _find_styles(request: EvaluateRequest, policy: OnnxPolicy) -> list[str | None]:
    """Find the styles to follow; None for a policy without style curves."""
    if policy.contract.style is None:
        if request.style is not None:
            raise BadInputError(
                f"--style is {request.style}, expected none: policy '{request.policy}' follows no "
                "style curves"
            )
        return [None]
    names = (NEAREST if request.style is None else request.style).split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"--style is {request.style}, expected each style once")
    with refusing():
        for name in names:
            load_followed(name, policy.robot)
    return [*names]


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


def _list_grounds(request: EvaluateRequest, name: str, world: World, rollouts: Rollouts) -> Grounds:
    """List the falls of a scene; on random ground every four have a ground of their own."""
    if request.falls is not None or not is_random(name):
        ground = SeededScene(name=name, seed=request.seed)
        return [(ground, _find_falls(request, world, rollouts.monitor))]
    seeds = seed_grounds(name, request.n // len(CLASSES), request.seed)
    grounds = [SeededScene(name=name, seed=seed) for seed in seeds]
    return rollouts.sample_falls(grounds, f"falls ({world.scene.name})")


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
