"""The log of a training: a CSV row and a report for every iteration."""

from __future__ import annotations

import csv
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim2real.training.config import STEPS, Recipe

COUNTED = ("falls", "stood", "alone", "stood_alone")
"""What is counted over an iteration; names in the environment's information, too."""


@dataclass(frozen=True, kw_only=True)
class TrainReport:
    """State of a training after an iteration."""

    iteration: int
    iterations: int
    steps: int
    """Policy steps of all robots so far."""
    seconds: float
    """Training time so far, resumed parts included [s]."""
    falls: int
    """Episodes from settled falls that ended in the last iteration."""
    stood: int
    """Number of them that ended in a stand, under exploration noise."""
    reward: float
    lift: float
    """Upper limit of the assistive force, as a fraction of the weight."""
    return_rate: float = 0.0
    """Mean task reward of following style curves, 0 without: the average return rate of
    [Frezzato22], section 6.4."""
    level: int = 0
    """Highest level of initial states that is open."""
    alone: int = 0
    """Number of these falls with hardly any assistive force."""
    stood_alone: int = 0
    """Number of those that ended in a stand."""
    height_alone: float = 0.0
    """Height of the neck at their end, as a share of that of the stance; 0 for none."""


class IterationLog:
    """Sums the steps of each iteration and writes a row."""

    def __init__(
        self,
        file: Path,
        recipe: Recipe,
        report: Callable[[TrainReport], None],
    ) -> None:
        self._file, self._recipe, self._report = file, recipe, report
        self._clear()
        self._start, self._seconds_before = time.monotonic(), 0.0
        self._iteration = 0

    def resume(self, iteration: int) -> None:
        """Keep the rows before an iteration and continue from there."""
        self._iteration = iteration
        if not self._file.exists():
            return
        with self._file.open(newline="") as stream:
            rows = [row for row in csv.DictReader(stream) if int(row["iteration"]) < iteration]
        self._seconds_before = float(rows[-1]["seconds"]) if rows else 0.0
        with self._file.open("w", newline="") as stream:
            writer = csv.DictWriter(stream, list(TrainReport.__dataclass_fields__))
            writer.writeheader()
            writer.writerows(rows)

    def __call__(self, reward: float, info: dict[str, Any]) -> None:
        """Count one policy step by its mean reward and the environment's information."""
        self._rewards.append(reward)
        self._task_rewards.append(info["task_reward"])
        self._counts.update({name: info[name] for name in COUNTED})
        self._height += info["height_alone"]
        if len(self._rewards) < STEPS:
            return
        report = TrainReport(
            iteration=self._iteration,
            iterations=self._recipe.iterations,
            steps=(self._iteration + 1) * STEPS * self._recipe.robots,
            seconds=round(self._seconds_before + time.monotonic() - self._start, 1),
            reward=round(float(np.mean(self._rewards)), 4),
            lift=round(info["assistive_force"], 3),
            return_rate=round(float(np.mean(self._task_rewards)), 4),
            level=info["level"],
            height_alone=round(self._height / max(self._counts["alone"], 1), 3),
            **{name: self._counts[name] for name in COUNTED},
        )
        self._iteration += 1
        self._clear()
        row = asdict(report)
        is_new = not self._file.exists()
        with self._file.open("a", newline="") as stream:
            writer = csv.DictWriter(stream, list(row))
            if is_new:
                writer.writeheader()
            writer.writerow(row)
        self._report(report)

    def _clear(self) -> None:
        self._rewards, self._task_rewards = list[float](), list[float]()
        self._counts, self._height = Counter[str](), 0.0
