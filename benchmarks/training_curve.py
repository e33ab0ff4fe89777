"""Draws how trainings went: the share of settled falls that end standing, over time.

python benchmarks/training_curve.py out/quick out/robust --out curve.png
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import tyro
from training_progress import TrainingProgress


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
        progress = TrainingProgress.read(folder)
        label = f"{folder.name}: {progress.steps[-1] / 1e6:.1f} million policy steps"
        axes.plot(progress.seconds / 60.0, 100.0 * progress.share, label=label)
    axes.set_xlabel("time [min]")
    axes.set_ylabel("falls that end standing [%]")
    axes.set_title("While it explores, hard falls drawn more often", fontsize="medium")
    axes.set_ylim(0.0, 100.0)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(options.out, dpi=120)


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.OmitArgPrefixes,)))
