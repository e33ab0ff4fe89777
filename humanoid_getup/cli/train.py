"""`getup train`: train a get-up policy."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from humanoid_getup.cli.errors import BadInputError, needing, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.policies import Train
from humanoid_getup.cli.output import console_for, phase

if TYPE_CHECKING:
    from sim2real.training.iteration_log import TrainReport

LEARNED = 0.2  # share of falls that end standing, from which a body is learning
RECENT = 20  # iterations whose falls are counted: enough for a steady share
SPEED_WINDOW = 300.0  # s over which the speed is measured: several iterations


def train(command: Train) -> int:
    """Train, or continue a training."""
    parent = command.parent
    if parent is not None and not parent.is_dir() and parent.suffix != ".onnx":
        raise BadInputError(
            f"--parent is {parent}, expected the folder of a training, or a policy file"
        )
    if command.prior is not None and not command.prior.is_dir():
        raise BadInputError(f"--prior is {command.prior}, expected the folder of a pose prior")
    robot = load_robot(command)
    with phase("loading torch"), needing("train"):
        import torch

        from sim2real.training.checkpoint import CHECKPOINT
        from sim2real.training.config import RECIPES
        from sim2real.training.distributed import DistributedProcess
        from sim2real.training.train import check_inputs, train
    _check_device(command.device, has_gpu=torch.cuda.is_available())
    recipe = RECIPES[command.recipe]
    recipe = replace(
        recipe,
        iterations=command.iterations or recipe.iterations,
        robots=command.robots or recipe.robots,
    )
    with refusing():
        robot.require_imu_site()
        check_inputs(robot, recipe, command.out, command.parent, command.prior)
    leads = DistributedProcess.from_environment(os.environ).leads
    checkpoint = command.out / CHECKPOINT
    with refusing(), show_progress(recipe.iterations, checkpoint, shown=leads) as progress:
        train(
            robot,
            recipe,
            command.seed,
            command.out,
            device=command.device,
            threads=command.threads,
            parent=command.parent,
            prior=command.prior,
            report=progress.note,
        )
    if leads:
        console_for(None).print(f"{command.out}: {progress.summary}")
        if progress.share < LEARNED:
            console_for(None).print(
                f"it has not learned to get up yet; `getup robots check {command.robot}` names "
                "joints that are too weak, and the same command with more --iterations goes on",
                markup=False,
            )
    return DID_IT


def _check_device(device: str, *, has_gpu: bool) -> None:
    name, _, number = device.partition(":")
    is_numbered = number.isdecimal() or device == name
    if is_numbered and (name == "cpu" or (name == "cuda" and has_gpu)):
        return
    expected = "cpu or cuda" if has_gpu else "cpu: torch finds no GPU here"
    raise BadInputError(f"--device is '{device}', expected {expected}")


class TrainingProgress:
    """Progress of a training, in words and in a bar."""

    def __init__(self, bar: Progress, iterations: int) -> None:
        self._bar = bar
        self._task = bar.add_task("training", total=iterations, stood="", rate="")
        self._recent: deque[TrainReport] = deque(maxlen=RECENT)

    def note(self, report: TrainReport) -> None:
        """Record one iteration's report."""
        self._recent.append(report)
        done = report.iteration + 1
        self._bar.update(self._task, completed=done, stood=f"{self.share:.0%} stand")
        if speed := self._bar.tasks[0].speed:  # iterations/s
            self._bar.update(self._task, rate=f"{speed * report.steps / done:,.0f} steps/s")

    @property
    def share(self) -> float:
        """Return the share of recent falls that ended standing; nan for none."""
        falls = sum(report.falls for report in self._recent)
        return sum(report.stood for report in self._recent) / falls if falls else math.nan

    @property
    def summary(self) -> str:
        """Summarize how the training ended."""
        if not self._recent:
            return "trained already, for the requested number of iterations"
        last = self._recent[-1]
        return (
            f"{last.iteration + 1} iterations, {last.steps / 1e6:.2f} million steps in "
            f"{format_time(last.seconds)}; recently {self.share:.0%} of falls ended standing"
        )


@contextmanager
def show_progress(iterations: int, checkpoint: Path, *, shown: bool) -> Iterator[TrainingProgress]:
    """Show a progress bar on standard error; yield what advances it."""
    columns = (
        "training",
        BarColumn(),
        MofNCompleteColumn(),
        "{task.fields[stood]}",
        "{task.fields[rate]}",
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, disable=not shown, speed_estimate_period=SPEED_WINDOW
    ) as bar:
        try:
            yield TrainingProgress(bar, iterations)
        except KeyboardInterrupt:
            if checkpoint.exists():
                console.print("the last checkpoint is kept: the same command continues from it")
            else:
                console.print("there is no checkpoint yet: the same command starts again")
            raise


def format_time(seconds: float) -> str:
    """Write a duration for people: 42 s, 7 min, 1 h 05 min."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
