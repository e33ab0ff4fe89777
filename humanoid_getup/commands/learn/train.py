"""`getup train` and `export`: train a policy, continue a training, export what it has learned."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import BadInputError, needing, refusing
from humanoid_getup.commands.files import FOLDER, MADE, READ, ROBOT
from humanoid_getup.commands.inputs import load_robot, load_robot_of
from humanoid_getup.commands.options import RobotOption, Seed
from humanoid_getup.motions.motion_database import list_motions
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.physics_engine import PhysicsEngine
from robots.storage.validation import at_least

if TYPE_CHECKING:
    from sim2real.training.export import Exported
    from sim2real.training.iteration_log import TrainReport


CHECKPOINT = "checkpoint.pt"
MOST_THREADS = 256
RECENT = 20  # iterations whose falls are counted: enough for a steady share
LEARNED = 0.2  # share of falls without help that end standing, from which a body is learning
ASSESSED = 600.0  # s of training after which it should be
MORE = "more --iterations may do"
DOWN = 0.5  # of the standing neck height, below which robots do not get off the ground


@dataclass(frozen=True, kw_only=True)
class TrainRequest(RobotOption):
    """Train a policy that gets the robot up; the same command again continues a training."""

    out: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder for checkpoint, progress and TensorBoard files."""
    recipe: Literal["quick", "backwards", "robust", "gentle", "rough", "styled-quick", "styled"] = (
        "quick"
    )
    """Training recipe."""
    parent: Annotated[Path | None, READ, arg(metavar="DIR|FILE.onnx")] = None
    """Folder of a training whose policy is the initial one, or a policy file (.onnx) with the same
    actions; default: random weights."""
    prior: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder of a pose prior, see `getup prior`, for a training with style curves."""
    seed: Seed = 0
    threads: Annotated[int, at_least(0, at_most=MOST_THREADS)] = 0
    """Threads that step physics; 0: all of the machine."""
    device: str = "cpu"
    """Device of the networks: cpu or cuda."""
    physics: Literal["mujoco", "warp"] = "mujoco"
    """Engine that steps physics: mujoco on the processor, or warp (mujoco-warp) on a GPU: that of
    the networks, else the first one, else the processor, which is slow."""
    iterations: Annotated[int | None, at_least(1)] = None
    """Updates of the policy; default: the recipe's."""
    robots: Annotated[int | None, at_least(1)] = None
    """Number of robots that are simulated at once; default: the recipe's."""


@command("train")
def train(request: TrainRequest, monitor: ProgressMonitor) -> TrainedPolicy:
    """Train into the request's folder, or continue the training in it."""
    try:
        return _train(request, monitor)
    except KeyboardInterrupt as interrupt:
        if (request.out / CHECKPOINT).exists():
            hint = "the last checkpoint is kept: the same command continues from it"
        else:
            hint = "there is no checkpoint yet: the same command starts again"
        raise KeyboardInterrupt(hint) from interrupt


@train.show
def _print(trained: TrainedPolicy, request: TrainRequest, console: Console) -> None:
    console.print(f"{request.out}: {trained}")
    if trained.recent and not trained.is_learning:
        text = f"{trained.assess()}; the same command with more --iterations continues"
        console.print(text, markup=False)


def _train(request: TrainRequest, monitor: ProgressMonitor) -> TrainedPolicy:
    parent, prior = request.parent, request.prior
    if parent is not None and not parent.is_dir() and parent.suffix != ".onnx":
        raise BadInputError(
            f"--parent is {parent}, expected the folder of a training, or a policy file"
        )
    if prior is not None and not prior.is_dir():
        raise BadInputError(f"--prior is {prior}, expected the folder of a pose prior")
    robot = load_robot(request)
    monitor.begin("loading torch")
    with needing("train"):
        from sim2real.training.config import RECIPES
        from sim2real.training.train import Training
    _check_device(request.device)
    if request.physics == "warp":
        monitor.begin("loading mujoco-warp, whose kernels compile for minutes the first time")
        with needing("warp"):
            PhysicsEngine("warp").load()
    recipe = RECIPES[request.recipe]
    recipe = replace(
        recipe,
        iterations=request.iterations or recipe.iterations,
        robots=request.robots or recipe.robots,
        physics=request.physics,
    )
    motions = len(list_motions(robot))
    trained = TrainedPolicy(motions=motions, lift=recipe.lift)

    def note(each: TrainReport) -> None:
        if said := trained.note(each):
            monitor.tell(said)
        text = f"{trained.describe()}, {each.steps / max(each.seconds, 1e-9):,.0f} steps/s"
        done = each.iteration + 1
        monitor.show(Progress(phase="training", done=done, total=recipe.iterations, note=text))

    training = Training(
        robot=robot,
        recipe=recipe,
        folder=request.out,
        seed=request.seed,
        parent=parent,
        prior=prior,
        device=request.device,
        threads=request.threads,
    )
    with refusing():
        robot.require_imu_site()
        training.run(note)
    return trained


def _check_device(device: str) -> None:
    from torch import cuda

    has_gpu = cuda.is_available()
    name, _, number = device.partition(":")
    is_numbered = number.isdecimal() or device == name
    if is_numbered and (name == "cpu" or (name == "cuda" and has_gpu)):
        return
    expected = "cpu or cuda" if has_gpu else "cpu: torch finds no GPU here"
    raise BadInputError(f"--device is '{device}', expected {expected}")


class TrainedPolicy:
    """State of a training, from the reports of its iterations.

    The assistive force holds robots up: falls with more than a little of it do not count as
    stood.
    """

    def __init__(self, *, motions: int, lift: float) -> None:
        """Begin without a report.

        Episodes start along the robot's stored motions, with at most ``lift`` of its weight held.
        """
        self._motions, self._lift = motions, lift
        self.recent: deque[TrainReport] = deque(maxlen=RECENT)
        """Reports of the last iterations; none if the training had as many as requested."""
        self._is_assessed = False

    def note(self, report: TrainReport) -> str:
        """Note a report; return what is to be told once, after ten minutes."""
        if not self.recent:
            is_continued = report.iteration > 0
            self._is_assessed = is_continued and report.seconds >= ASSESSED
        self.recent.append(report)
        if self._is_assessed or report.seconds < ASSESSED:
            return ""
        self._is_assessed = True
        return self.assess()

    @property
    def share(self) -> float:
        """Return the share of recent falls without help that ended standing; nan for none."""
        alone = sum(report.alone for report in self.recent)
        return sum(report.stood_alone for report in self.recent) / alone if alone else math.nan

    @property
    def is_learning(self) -> bool:
        """Tell whether robots get up by themselves, need less help, or begin farther away."""
        if self.share >= LEARNED:
            return True
        return bool(self.recent) and (self.recent[-1].lift < self._lift or self._level > 0)

    @property
    def _level(self) -> int:
        return self.recent[-1].level

    def describe(self) -> str:
        """Describe how many recent falls end standing, and how much robots are helped."""
        lift, falls = self.recent[-1].lift, sum(report.falls for report in self.recent)
        if not falls:
            way = f"; episodes begin on the way, up to level {self._level}" if self._level else ""
            return f"no fall has ended yet{way}"
        stood = sum(report.stood for report in self.recent) / falls
        if not lift:
            return f"{stood:.0%} of falls end standing"
        helped = f"{stood:.0%} of falls end standing with up to {lift:.0%} of the weight held"
        return helped if math.isnan(self.share) else f"{helped}, {self.share:.0%} without help"

    def assess(self) -> str:
        """Tell whether a body is learning, and what it may lack."""
        said = f"after {format_time(self.recent[-1].seconds)} {self.describe()}: "
        if not self.is_learning and self.recent[-1].seconds < ASSESSED:
            return f"{said}too short to judge"
        return said + ("it is learning" if self.is_learning else f"not learned yet; {self._hint}")

    @property
    def _hint(self) -> str:
        alone = sum(report.alone for report in self.recent)
        if not any(report.falls for report in self.recent):
            return MORE
        neck = sum(report.alone * report.height_alone for report in self.recent) / max(alone, 1)
        height = f"necks end at {neck:.0%} of the standing height; "
        if not self._motions:
            return (
                f"{height}no motion is stored to start along: `getup motions discover` finds some"
            )
        if neck < DOWN:
            return f"{height}`getup robots check` names joints that are too weak to lift the robot"
        return f"{height}{MORE}"

    def __str__(self) -> str:
        """Summarize how the training ended."""
        if not self.recent:
            return "trained already, for the requested number of iterations"
        last = self.recent[-1]
        return (
            f"{last.iteration + 1} iterations, {last.steps / 1e6:.2f} million steps in "
            f"{format_time(last.seconds)}; recently {self.describe()}"
        )


def format_time(seconds: float) -> str:
    """Format a duration: 42 s, 7 min, 1 h 05 min."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


@dataclass(frozen=True, kw_only=True)
class ExportRequest(RobotOption):
    """Export the policy of a training, as far as it has come, to one ONNX file."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the training."""
    out: Annotated[Path, MADE, arg(metavar="FILE")]
    """ONNX file to write; an existing file is replaced."""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: the training's."""


@command("export")
def export(request: ExportRequest, monitor: ProgressMonitor) -> Exported:
    """Export the policy of a training, as far as it has come, to one ONNX file."""
    monitor.begin("loading torch")
    with needing("train"):
        from sim2real.training.config import TrainingRecord
        from sim2real.training.export import export_policy
    monitor.begin("exporting")
    with refusing():
        training = TrainingRecord.load(request.folder)
        robot = load_robot_of(request, training.robot, f"training {request.folder}")
        return export_policy(training, robot, request.out)


@export.show
def _print_exported(exported: Exported, request: ExportRequest, console: Console) -> None:
    console.print(
        f"{request.out}: {exported.size / 1e3:.0f} kB, after {exported.iterations} iterations; "
        f"torch and onnxruntime differ by {exported.difference:.1e} at most"
    )
