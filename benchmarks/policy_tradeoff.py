"""Draws what ways of getting up pay for their success: torque, and impact of the head.

getup bench methods --ways quick robust gentle plan --json methods.json
python benchmarks/policy_tradeoff.py methods.json --out tradeoff.png
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import tyro

COSTS = {
    "rms_torque_nm": "RMS torque of a rise [N·m]: dot median, bar to 95 %",
    "head_impact_m_s": "head impact [m/s]: dot median, bar to 95 %",
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Draw the figures of `getup bench methods`."""

    figures: Annotated[Path, tyro.conf.Positional]
    """Its JSON file."""
    out: Path


def main(options: Options) -> None:
    """Draw a panel for each cost, and in it a point for each way."""
    record = json.loads(options.figures.read_text("utf-8"))
    figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.0), sharey=True, layout="constrained")
    for axes, (key, label) in zip(panels, COSTS.items(), strict=True):
        for i, (name, row) in enumerate(record["cases"].items()):
            stood = 100.0 * row["stood"] / row["n"]
            low, high = (100.0 * bound for bound in row["stood_interval_95"])
            cost = row[key]
            axes.errorbar(
                [cost["median"]],
                [stood],
                xerr=[[0.0], [cost["p95"] - cost["median"]]],
                yerr=[[stood - low], [high - stood]],
                fmt="o",
                capsize=3,
                color=f"C{i}",
                label=f"{name}: {row['stood']} of {row['n']}",
            )
        axes.set_xlabel(label)
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("stood [%], with 95 % interval")
    panels[0].legend()
    figure.savefig(options.out, dpi=120)


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.OmitArgPrefixes,)))
