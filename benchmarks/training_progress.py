"""The progress of a training over time, as its `progress.csv` has it."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

WINDOW = 15  # iterations that are averaged: some 70 falls end in each


@dataclass(frozen=True, kw_only=True)
class TrainingProgress:
    """Progress at the end of each iteration, (I,)."""

    seconds: np.ndarray
    """[s]"""
    steps: np.ndarray
    """Policy steps of all robots."""
    share: np.ndarray
    """Share of settled falls that ended standing, over the last iterations."""

    @staticmethod
    def read(folder: Path) -> TrainingProgress:
        """Read the progress of the training in a folder."""
        with (folder / "progress.csv").open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        seconds, steps, ended, stood = (
            np.array([float(row[name]) for row in rows])
            for name in ("seconds", "steps", "falls", "stood")
        )
        share = _sum(stood) / np.maximum(_sum(ended), 1.0)
        return TrainingProgress(seconds=seconds, steps=steps, share=share)

    def steps_per_s(self, begin: int) -> float:
        """Return policy steps per second after an iteration."""
        steps, seconds = self.steps[begin:], self.seconds[begin:]
        return float((steps[-1] - steps[0]) / (seconds[-1] - seconds[0]))


def _sum(values: np.ndarray) -> np.ndarray:
    """Add up the last so many values at each place."""
    total = np.cumsum(values)
    return total - np.concatenate((np.zeros(WINDOW), total))[: len(total)]
