"""Evaluates a policy: success, time and load of its rises from settled falls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.inputs import load_robot, load_world, make_torque_limit
from humanoid_getup.commands.pieces import make_absolute, make_worker_request, starting
from humanoid_getup.commands.policies import load_policy, name_robot
from humanoid_getup.engines.executor import do_pieces
from humanoid_getup.experiments.judging.summary import PolicySummary
from humanoid_getup.experiments.starts.falls import (
    CLASSES,
    Fall,
    FallSet,
    FallSetError,
    sample_fall_set,
)
from humanoid_getup.jobs.requests.learning import EvaluateRequest
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.policy.style_follower import StyleChoice
from humanoid_getup.progress.callback import Cancel, Progress, ProgressMonitor, Report
from humanoid_getup.progress.worker import report
from humanoid_getup.scenes.named_scenes import is_random, load_scene, seed_grounds
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from humanoid_getup.strategies.styled_rise import PLANNED, read_curves
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.extraction import ExtractionError
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import load_any_style, load_style
from robots import Robot

if TYPE_CHECKING:  # torch is slow to import
    from sim2real.perturbations import Perturbation
    from sim2real.policy_evaluation import PolicyFigures
NEAREST = "nearest"
"""Style without a choice: the nearest of all named ones."""
PLAN_SHARE = 0.9
"""Of the time that a planned rise takes, where a policy follows the curves of its plan."""
Curves = list[StyleCurves | None]
Piece = TypeVar("Piece")
Result = TypeVar("Result")


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
    names = _split("--scene", request.scene, "scene")
    if len(names) > 1 and request.falls is not None:
        raise BadInputError(f"--falls is {request.falls}, expected one --scene with it")
    return names


def _split(option: str, text: str, noun: str) -> list[str]:
    """Split the value of an option into names."""
    names = text.split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"{option} is {text}, expected each {noun} once")
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
    names = _split("--style", NEAREST if request.style is None else request.style, "style")
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


@dataclass(frozen=True, kw_only=True)
class SeededScene:
    """A scene, with the seed of its ground if that is random."""

    name: str
    """Its name, or file."""
    seed: int

    def load(self, robot: Robot) -> Scene:
        """Load the scene for a robot."""
        return load_scene(self.name, robot, self.seed)


Grounds = list[tuple[SeededScene, FallSet]]
"""Each ground with the falls on it."""


@dataclass(frozen=True, kw_only=True)
class RolloutPiece:
    """Rollouts of a policy from some falls on one ground, at once."""

    ground: SeededScene
    falls: tuple[Fall, ...]
    first: int
    """Number of the first of the falls among those on this ground."""
    style: str | None
    """Name or file of the style that it follows; None for a policy without style curves."""
    seed: int
    """Of what is random about its robots."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RolledOut:
    """Figures of some rollouts."""

    figures: PolicyFigures
    planned: int
    """Number of rises that followed the curves of a plan."""


class EvaluatedPolicy:
    """The policy of a request on its robots; what is sent to a worker loads it there."""

    def __init__(self, request: EvaluateRequest, threads: int = 0) -> None:
        """Load the policy of a request, whose physics takes a number of threads."""
        self.request, self.threads = request, threads
        self.robot = load_robot(request)
        self.limit = make_torque_limit(request, self.robot)
        self.policy = load_policy(self.robot, request.policy, self.limit.value)

    def __reduce__(self) -> tuple[Any, ...]:
        return EvaluatedPolicy, (self.shared, 1)

    @property
    def shared(self) -> EvaluateRequest:
        """Return the request of workers: pieces name scene, style and falls."""
        policy = make_absolute(self.request.policy)
        changes = {"policy": policy, "scene": "flat", "style": None, "falls": None}
        return make_worker_request(EvaluateRequest, self.request, **changes)

    @cached_property
    def perturbation(self) -> Perturbation:
        """Make the perturbation of the request."""
        from sim2real.perturbations import Perturbation

        request = self.request
        return Perturbation(
            torque_limit=self.limit.value,
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

    def sample_falls(self, ground: SeededScene) -> FallSet:
        """Sample a fall of each class on a ground."""
        world = World(self.robot, ground.load(self.robot))
        with refusing():
            return sample_fall_set(world, dict.fromkeys(CLASSES, 1), ground.seed)

    def roll_out(self, piece: RolloutPiece) -> RolledOut:
        """Let the policy get up from falls, and report robots as they are done."""
        from sim2real.perturbations import PolicyTrial
        from sim2real.policy_evaluation import PolicyDriver

        choice, planned = self._choose_curves(piece)
        trial = PolicyTrial(
            robot=self.robot,
            policy=PolicyDriver.of(self.policy, choice, sees_ground=self.request.height_map),
            perturbation=self.perturbation,
            seed=piece.seed,
            scene=piece.ground.load(self.robot),
            threads=self.threads,
        )
        share = 1.0 - PLAN_SHARE if piece.style == PLANNED else 1.0
        starts = [fall.posture for fall in piece.falls]
        rollouts = trial.run(starts, lambda robots: report(Progress(done=share * robots)))
        return RolledOut(figures=rollouts.figures, planned=planned)

    def _choose_curves(self, piece: RolloutPiece) -> tuple[StyleChoice | None, int]:
        """Make the choice of curves; count rises that follow a plan's curves."""
        if piece.style is None:
            return None, 0
        with refusing():
            style = load_followed(piece.style, self.robot)
        if piece.style != PLANNED:
            return lambda _row, features: style.choose(features), 0
        curves = self._plan_curves(piece)
        found = sum(each is not None for each in curves)
        return lambda row, features: curves[row] or style.choose(features), found

    def _plan_curves(self, piece: RolloutPiece) -> Curves:
        """Plan a motion for each fall, and read its curves; ``None`` where no plan stands."""
        world = World(self.robot, piece.ground.load(self.robot))
        planner = PlannedRise(world, options=PlannerOptions(threads=self.threads))
        found: Curves = []
        for number, fall in enumerate(piece.falls, piece.first):
            rng = np.random.default_rng([self.request.seed, number])
            plan = planner.plan(fall.posture, rng)
            found.append(None)
            if isinstance(plan, MotionPlan) and plan.motion.rises:
                with suppress(ExtractionError):
                    found[-1] = read_curves(world, plan.motion)
            report(Progress(done=PLAN_SHARE))
        return found


def load_followed(name: str, robot: Robot) -> Style:
    """Load a style to follow, by name; for curves of plans, that of falls without one."""
    return load_any_style(robot) if name in (NEAREST, PLANNED) else load_style(name, robot)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rollouts:
    """Rollouts of a policy on the engine of a request."""

    evaluated: EvaluatedPolicy
    """Does them in this process."""
    executor: Executor
    monitor: ProgressMonitor

    def sample_falls(self, grounds: Sequence[SeededScene], phase: str) -> Grounds:
        """Sample a fall of each class on each ground."""
        count = self.monitor.count(phase, len(grounds) * len(CLASSES))
        pieces = {str(ground.seed): ground for ground in grounds}

        def end(_name: str, falls: FallSet) -> None:
            count(len(falls.falls))

        found = self._do(self.evaluated.sample_falls, pieces, end)
        return list(zip(grounds, found.values(), strict=True))

    def roll_out(self, pieces: Sequence[RolloutPiece], phase: str) -> list[RolledOut]:
        """Let the policy get up from all falls."""
        total = sum(len(piece.falls) for piece in pieces)
        count = self.monitor.count(phase, total)
        named = {str(number): piece for number, piece in enumerate(pieces)}
        ended, reported = 0, 0.0

        def receive(progress: Progress) -> None:
            nonlocal reported
            done = min(progress.done, total - reported)  # a piece that is done again reports again
            reported += done
            count(done)

        def end(name: str, _result: RolledOut) -> None:
            nonlocal ended
            ended += len(named[name].falls)
            if ended > reported:  # workers elsewhere report nothing
                receive(Progress(done=ended - reported))

        return list(self._do(self.evaluated.roll_out, named, end, receive).values())

    def _do(
        self,
        work: Callable[[Piece], Result],
        pieces: Mapping[str, Piece],
        end: Callable[[str, Result], None],
        receive: Callable[[Progress], None] | None = None,
    ) -> dict[str, Result]:
        return do_pieces(
            work,
            pieces,
            self.executor,
            ended=end,
            monitor=self.monitor,
            robot=self.evaluated.shared.robot,
            receive=receive,
        )


def cut_falls(grounds: Grounds, style: str | None, *, most: int, seed: int) -> list[RolloutPiece]:
    """Cut the falls on grounds into pieces of at most a number of robots, with seeds."""
    parts = [
        (ground, falls.falls, first)
        for ground, falls in grounds
        for first in range(0, len(falls.falls), most)
    ]
    return [
        RolloutPiece(
            ground=replace(ground, name=make_absolute(ground.name)),
            falls=falls[first : first + most],
            first=first,
            style=style and make_absolute(style),
            seed=seed * len(parts) + number,
        )
        for number, (ground, falls, first) in enumerate(parts)
    ]
