"""`getup eval`: success, time and load of a policy's rises from settled falls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.files import READ, ROBOT, find_file_problems
from humanoid_getup.commands.inputs import load_robot, load_world, make_torque_limit
from humanoid_getup.commands.options import EngineOptions, PolicyName, SceneOptions, TorqueOptions
from humanoid_getup.commands.pieces import make_absolute, make_robot_absolute, starting
from humanoid_getup.commands.policies import name_robot
from humanoid_getup.engines.executor import do_pieces
from humanoid_getup.engines.versions import checked
from humanoid_getup.experiments.disturbances import RandomAxis
from humanoid_getup.experiments.falls import (
    CLASSES,
    FallSet,
    sample_fall_set,
)
from humanoid_getup.experiments.judging.record import combine_arrays
from humanoid_getup.experiments.judging.summary import PolicySummary, Quantiles
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.scenes.named_scenes import is_random, seed_grounds
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.storage.validation import at_least, between

if TYPE_CHECKING:  # slow to import
    from sim2real.evaluation import EvaluatedPolicy, Grounds, RolloutPiece
    from sim2real.policy_evaluation import PolicyFigures
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
"""Keys of the figures of a followed style."""
LEGEND = (
    "median (95th percentile); times and torques are those of rises that stood, all else of all; "
    "stood (paper): for 3 s from the end of the given curves on, without a restart"
)


@dataclass(frozen=True, kw_only=True)
class EvaluateRequest(EngineOptions, TorqueOptions, SceneOptions):
    """Evaluate a policy on settled falls that no training saw, by class, with intervals."""

    policy: Positional[PolicyName]
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
    scene: Annotated[str, READ, arg(metavar="SCENE,...")] = "flat"
    """Names of scenes, see `getup scenes`, or scene files (.toml), with commas between them."""
    style: Annotated[str | None, READ, arg(metavar="STYLE,...")] = None
    """Styles that a policy with style curves follows, with commas between them: names, files,
    planned for the curves of a motion that is planned for each fall, or nearest, the default: of
    the named styles that begin nearest to the robot, the one that turns it least."""
    height_map: bool = False
    """Let a policy with a height map observe the ground; otherwise it assumes level ground."""
    n: Annotated[int, at_least(4, step=4)] = 1000
    """Number of falls in each scene, equally many of each class. Rough ground is another one for
    every four of them, unless they are read from a file."""
    falls: Annotated[Path | None, READ, arg(metavar="FILE")] = None
    """File of falls: read if it exists, else written."""
    delay: Annotated[float, between(0.0, 60.0, "ms"), arg(metavar="MS")] = 0.0
    """Delay of targets on their way to the servos [ms]."""
    voltage: Annotated[float | None, between(1.0, 30.0, "V"), arg(metavar="V")] = None
    """Supply voltage [V]; default: the robot's nominal one."""
    friction: Annotated[float | None, between(0.01, 10.0)] = None
    """Sliding friction coefficient of every contact; default: the scene's."""
    mass: Annotated[float, between(0.1, 10.0), arg(metavar="FACTOR")] = 1.0
    """Factor on the mass of every link."""
    backlash: Annotated[float, between(0.0, 10.0, "deg"), arg(metavar="DEG")] = 0.0
    """Backlash of every gear [deg]."""
    weak_servo: Annotated[float, between(0.0, 1.0), arg(metavar="FACTOR")] = 1.0
    """Factor on the torque of one servo, a different one in each robot."""
    push: Annotated[float, between(0.0, 10.0, "m/s"), arg(metavar="M/S")] = 0.0
    """Velocity change by a push in a random direction, once a second [m/s]."""
    imu_tilt: Annotated[float, between(0.0, 90.0, "deg"), arg(metavar="DEG")] = 0.0
    """Mounting error of the IMU about a random axis [deg]."""
    gyro_bias: Annotated[float, between(0.0, 360.0, "deg/s"), arg(metavar="DEG/S")] = 0.0
    """Bias of the gyro about a random axis [deg/s]."""
    noise: bool = False
    """Add the sensor noise of training."""
    variant: Literal["1 ms steps", "elliptic cones", "other solver", "soft contacts"] | None = None
    """Model variant to evaluate in; default: the physics of training."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.falls is not None:
            yield from find_file_problems(self.falls)


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


@command("eval", json=True)
def evaluate(request: EvaluateRequest, monitor: ProgressMonitor) -> Evaluation:
    """Sample falls in each scene, let the policy get up from each in each style, judge."""
    request = name_robot(request, request.policy)
    names = _split("--scene", request.scene, "scene")
    if len(names) > 1 and request.falls is not None:
        raise BadInputError(f"--falls is {request.falls}, expected one --scene with it")
    monitor.begin("loading")
    worlds = {name: load_world(replace(request, scene=name)) for name in names}
    robot = load_robot(request)
    limit = make_torque_limit(request, robot)
    evaluated = _load_policy(request, limit)
    _check_policy(request, evaluated.policy)
    styles = _find_styles(request, evaluated.policy)
    cases: dict[str, EvaluatedCase] = {}
    with refusing(), starting(request, _count_pieces(request, names, styles)) as executor:
        rollouts = _Rollouts(request, evaluated, executor, monitor)
        for name, world in worlds.items():
            grounds = rollouts.list_grounds(name, world)
            for style in styles:
                label = ", ".join([world.scene.name, *([style] if style else [])])
                cases[label] = rollouts.evaluate(grounds, style, label)
    return Evaluation(
        policy=find_policy(robot, request.policy).stem,
        seed=request.seed,
        n=request.n,
        robot=robot.name,
        limit_by=limit.by,
        trial=evaluated.perturbation.label,
        height_map=request.height_map,
        cases=cases,
    )


@evaluate.show
def _print(found: Evaluation, _: EvaluateRequest, console: Console) -> None:
    for label, case in found.cases.items():
        text = f"{found.policy}, {label}; robots {found.trial}:\n\n{_tabulate(case)}\n"
        console.print(text, markup=False, soft_wrap=True)
    console.print(LEGEND, soft_wrap=True)


def _tabulate(case: EvaluatedCase) -> str:
    """Write the figures of a case as a Markdown table, by class and over all."""
    columns = {
        heading: key for heading, key in COLUMNS.items() if case.style or key not in FOLLOWED
    }
    counts = ("stood_paper", "followed") if case.style else ()
    rows = [["", "stood", "95 %", *("stood (paper)", "followed")[: len(counts)], *columns]]
    for name, row in (*case.classes.items(), ("all", case.all)):
        low, high = row.stood_interval_95
        interval = f"{100.0 * low:.0f} to {100.0 * high:.0f} %"
        cells = [_format_spread(getattr(row, key)) for key in columns.values()]
        more = [str(getattr(row, key)) for key in counts]
        rows.append([name, f"{row.stood} of {row.n}", interval, *more, *cells])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rule = ["-" * width for width in widths]
    lines = [rows[0], rule, *rows[1:]]
    return "\n".join(
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))} |"
        for line in lines
    )


def _format_spread(spread: Quantiles) -> str:
    """Write a median and, in parentheses, a 95th percentile; a dash for none."""
    median, p95 = spread.median, spread.p95
    return "-" if median is None or p95 is None else f"{median:.2f} ({p95:.2f})"


def _split(option: str, text: str, noun: str) -> list[str]:
    """Split the value of an option into names."""
    names = text.split(",")
    if len(set(names)) < len(names):
        raise BadInputError(f"{option} is {text}, expected each {noun} once")
    return names


def _load_policy(request: EvaluateRequest, limit: TorqueLimit) -> EvaluatedPolicy:
    from sim2real.evaluation import EvaluatedPolicy, Perturbation

    imu_tilt, gyro_bias = math.radians(request.imu_tilt), math.radians(request.gyro_bias)
    perturbation = Perturbation(
        torque_limit=limit.value,
        limit_by=request.limit_by,
        action_delay=request.delay / 1000.0,
        voltage=request.voltage,
        friction=request.friction,
        mass=request.mass,
        hinge_backlash=math.radians(request.backlash),
        weak_servo=request.weak_servo,
        push=request.push,
        imu_tilt=RandomAxis(imu_tilt) if imu_tilt else 0.0,
        gyro_bias=RandomAxis(gyro_bias) if gyro_bias else 0.0,
        noise=request.noise,
        physics=request.variant,
    )
    evaluated = EvaluatedPolicy(
        robot_name=make_robot_absolute(request.robot),
        policy_name=make_absolute(request.policy),
        perturbation=perturbation,
        sees_ground=request.height_map,
        seed=request.seed,
    )
    with refusing():
        _ = evaluated.policy
    return evaluated


def _check_policy(request: EvaluateRequest, policy: OnnxPolicy) -> None:
    """Refuse a part of the gains, and a missing height map."""
    if policy.action.gain_share:
        raise BadInputError(
            f"policy '{request.policy}' has a part of the servos' position gain, expected all of "
            "it: `getup run` plays it"
        )
    style = policy.contract.style
    if request.height_map and not (style and style.height_map):
        raise BadInputError(
            f"--height-map is given, expected none: policy '{request.policy}' has no height map"
        )


def _find_styles(request: EvaluateRequest, policy: OnnxPolicy) -> list[str | None]:
    """Find the styles to follow; None for a policy without style curves."""
    from sim2real.evaluation import NEAREST, load_followed

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


def _count_pieces(
    request: EvaluateRequest, names: Sequence[str], styles: Sequence[str | None]
) -> int:
    """Count the pieces of all rollouts."""
    from sim2real.evaluation import CHUNK

    each = request.n // len(CLASSES)
    random = [is_random(name) and request.falls is None for name in names]
    return len(styles) * sum(each if its else math.ceil(request.n / CHUNK) for its in random)


@dataclass(frozen=True, eq=False)
class _Rollouts:
    """Rollouts of a policy on the engine of a request."""

    request: EvaluateRequest
    evaluated: EvaluatedPolicy
    executor: Executor
    monitor: ProgressMonitor

    def list_grounds(self, name: str, world: World) -> Grounds:
        """List the falls of a scene; on random ground every four have a ground of their own."""
        from sim2real.evaluation import SeededScene

        request, file, phase = self.request, make_absolute(name), f"falls ({world.scene.name})"
        if request.falls is not None or not is_random(name):
            falls = self._find_falls(world, phase)
            return [(SeededScene(name=file, seed=request.seed), falls)]
        seeds = seed_grounds(name, request.n // len(CLASSES), request.seed)
        grounds = {str(seed): SeededScene(name=file, seed=seed) for seed in seeds}
        count = self.monitor.count(phase, len(grounds) * len(CLASSES))
        found = do_pieces(
            checked(self.evaluated.sample_falls, self.executor, self.evaluated.robot_name),
            grounds,
            self.executor,
            ended=lambda _, falls: count(len(falls.falls)),
            monitor=self.monitor,
        )
        return list(zip(grounds.values(), found.values(), strict=True))

    def _find_falls(self, world: World, phase: str) -> FallSet:
        """Read the falls from their file, or sample them."""
        request, each = self.request, self.request.n // len(CLASSES)
        if request.falls is not None and request.falls.exists():
            return FallSet.load(request.falls, world.robot, world.scene.name).choose(each)
        count = self.monitor.count(phase, request.n)
        falls = sample_fall_set(world, dict.fromkeys(CLASSES, each), request.seed, count)
        if request.falls is not None:
            falls.save(request.falls)
        return falls

    def evaluate(self, grounds: Grounds, style: str | None, label: str) -> EvaluatedCase:
        """Let the policy get up from all falls in a scene, in a style."""
        from sim2real.evaluation import cut_falls
        from sim2real.policy_evaluation import summarize_rollouts

        file = style and make_absolute(style)
        pieces = cut_falls(grounds, file, self.request.seed)
        found = self._roll_out(pieces, f"rises ({label})")
        falls = [fall for _, fall_set in grounds for fall in fall_set.falls]
        rises = combine_arrays(found, np.concatenate)
        figures = summarize_rollouts(falls, rises, CLASSES)
        return EvaluatedCase(
            scene=grounds[0][1].scene,
            style=style,
            falls_seed=grounds[0][1].seed,
            grounds=len(grounds),
            planned=UNSET if rises.planned is None else int(rises.planned.sum()),
            classes=figures.classes,
            all=figures.all,
        )

    def _roll_out(self, pieces: Sequence[RolloutPiece], phase: str) -> list[PolicyFigures]:
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

        def end(name: str, _: PolicyFigures) -> None:
            nonlocal ended
            ended += len(named[name].falls)
            if ended > reported:  # workers elsewhere report nothing
                receive(Progress(done=ended - reported))

        found = do_pieces(
            checked(self.evaluated.roll_out, self.executor, self.evaluated.robot_name),
            named,
            self.executor,
            ended=end,
            monitor=ProgressMonitor(receive, self.monitor.cancel),
        )
        return list(found.values())
