"""Draws how trainings went: the share of settled falls that end standing, over time.

python benchmarks/training_curve.py out/quick out/robust --out curve.png
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import tyro

WINDOW = 15  # iterations that are averaged: some 70 falls end in each


@dataclass(frozen=True, kw_only=True)
class Options:
    """Draw trainings."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders of trainings."""
    out: Path


def main(options: Options) -> None:
    """Draw a line for each training."""
    figure, axes = plt.subplots(figsize=(8.0, 4.0), layout="constrained")
    for folder in options.folders:
        with (folder / "progress.csv").open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        ended = np.array([float(row["falls"]) for row in rows])
        stood = np.array([float(row["stood"]) for row in rows])
        minutes = np.array([float(row["seconds"]) for row in rows]) / 60.0
        share = _sum(stood) / np.maximum(_sum(ended), 1.0)
        steps = float(rows[-1]["steps"]) / 1e6
        axes.plot(minutes, 100.0 * share, label=f"{folder.name}: {steps:.1f} million policy steps")
    axes.set_xlabel("time [min]")
    axes.set_ylabel("falls that end standing [%]")
    axes.set_title("While it explores, hard falls drawn more often", fontsize="medium")
    axes.set_ylim(0.0, 100.0)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(options.out, dpi=120)


def _sum(values: np.ndarray) -> np.ndarray:
    """Add up the last so many values at each place."""
    total = np.cumsum(values)
    return total - np.concatenate((np.zeros(WINDOW), total))[: len(total)]


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.OmitArgPrefixes,)))
