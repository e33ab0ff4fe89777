"""`getup train`: train a get-up policy."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from tyro.conf import arg

from humanoid_getup.cli.checks import at_least
from humanoid_getup.cli.errors import BadInputError, needing, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import RobotOption, Seed
from humanoid_getup.cli.output import console_for, find_folder_faults, phase

REMEMBERED = 20  # last reports: long enough to be steady, short enough to follow changes


class TrainingSpeed:
    """Rate over the last reports, including all that happens between them."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque(maxlen=REMEMBERED)

    def note(self, now: float, done: int) -> None:
        """Record the amount done at a time [s]."""
        self._seen.append((now, done))

    @property
    def rate(self) -> float:
        """Return the amount done per second; nan before the second report."""
        if len(self._seen) < 2 or self._seen[-1][0] <= self._seen[0][0]:
            return math.nan
        (began, before), (now, done) = self._seen[0], self._seen[-1]
        return (done - before) / (now - began)

    def time_to_go(self, total: int) -> float:
        """Return the remaining time at this rate [s]; nan before the second report."""
        if not self.rate > 0.0:
            return math.nan
        return (total - self._seen[-1][1]) / self.rate


def format_time(seconds: float) -> str:
    """Write a duration for people: 42 s, 7 min, 1 h 05 min; ? for nan."""
    if math.isnan(seconds):
        return "?"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


if TYPE_CHECKING:
    from sim2real.training.config import Recipe
    from sim2real.training.progress import TrainReport


@dataclass(frozen=True, kw_only=True)
class Train(RobotOption):
    """Train a policy that gets the robot up; the same command again continues a training."""

    out: Annotated[Path, arg(metavar="DIR")]
    """Folder for checkpoint, progress and TensorBoard files."""
    recipe: Literal["quick", "robust", "gentle"] = "quick"
    """Training recipe."""
    parent: Annotated[Path | None, arg(name="from", metavar="DIR")] = None
    """Folder of a training whose policy is the initial one; default: random weights."""
    seed: Seed = 0
    threads: Annotated[int, at_least(0)] = 0
    """Threads that step physics; 0: all of the machine."""
    device: str = "cpu"
    """Device of the networks: cpu or cuda."""
    iterations: Annotated[int | None, at_least(1)] = None
    """Updates of the policy; default: the recipe's."""
    robots: Annotated[int | None, at_least(1)] = None
    """Robots that are simulated side by side; default: the recipe's."""

    def run(self) -> int:
        """Train, or continue a training."""
        faults = find_folder_faults(self.out, ())
        if self.parent is not None and not self.parent.is_dir():
            faults.append(f"--from is {self.parent}, expected the folder of a training")
        if faults:
            raise BadInputError("; ".join(faults))
        robot = self.load_robot()
        with phase("loading torch"), needing("train"):
            from sim2real.training.distributed import DistributedProcess
            from sim2real.training.train import train
        recipe = self._choose_recipe()
        self._check_device()
        leads = DistributedProcess.from_environment(os.environ).leads
        with refusing(), learning(recipe.iterations, shown=leads) as learned:
            train(
                robot,
                recipe,
                self.seed,
                self.out,
                device=self.device,
                threads=self.threads,
                parent=self.parent,
                report=learned.note,
            )
        if leads:
            console_for(None).print(f"{self.out}: {learned.summary}")
        return DID_IT

    def _choose_recipe(self) -> Recipe:
        from sim2real.training.config import RECIPES

        recipe = RECIPES[self.recipe]
        return replace(
            recipe,
            iterations=self.iterations or recipe.iterations,
            robots=self.robots or recipe.robots,
        )

    def _check_device(self) -> None:
        import torch

        try:
            kind = torch.device(self.device).type
        except RuntimeError:
            kind = None
        if kind == "cpu" or (kind == "cuda" and torch.cuda.is_available()):
            return
        expected = "cpu or cuda" if torch.cuda.is_available() else "cpu: torch finds no GPU here"
        raise BadInputError(f"--device is '{self.device}', expected {expected}")


class Learned:
    """Progress of a training, in words and in a bar."""

    def __init__(self, show: Callable[..., None]) -> None:
        self._show, self._speed = show, TrainingSpeed()
        self._recent: deque[TrainReport] = deque(maxlen=REMEMBERED)

    def note(self, report: TrainReport) -> None:
        """Record one iteration's report."""
        self._recent.append(report)
        self._speed.note(time.monotonic(), report.steps)
        total = report.steps // (report.iteration + 1) * report.iterations
        self._show(
            completed=report.iteration + 1,
            stood=f"{self.share:.0%} stand",
            rate=f"{self._speed.rate:,.0f} steps/s",
            left=f"{format_time(self._speed.time_to_go(total))} to go",
        )

    @property
    def share(self) -> float:
        """Return the share of recent falls that ended standing; nan for none."""
        falls = sum(report.falls for report in self._recent)
        return sum(report.stood for report in self._recent) / falls if falls else float("nan")

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
def learning(iterations: int, *, shown: bool) -> Iterator[Learned]:
    """Show a progress bar on standard error; yield what advances it."""
    fields = ("stood", "rate", "left")
    columns = (
        TextColumn("training"),
        BarColumn(),
        MofNCompleteColumn(),
        *(TextColumn(f"{{task.fields[{name}]}}") for name in fields),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not shown) as progress:
        bar = progress.add_task("training", total=iterations, stood="", rate="", left="")
        try:
            yield Learned(lambda **fields: progress.update(bar, **fields))
        except KeyboardInterrupt:
            console.print("the last checkpoint is kept: the same command continues from it")
            raise
