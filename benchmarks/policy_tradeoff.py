"""Draws what ways of getting up pay for their success: torque, and impact of the head.

getup eval robust --n 1000 --seed 2 --json robust.json    # the same for other policies
getup bench methods --ways plan --json methods.json
python benchmarks/policy_tradeoff.py robust.json methods.json --out tradeoff.png
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import tyro

COSTS = {
    "rms_torque_nm": "RMS torque of a rise [N·m]",
    "head_impact_m_s": "head impact [m/s]",
}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Draw the figures of `getup eval` and `getup bench methods`."""

    figures: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Their JSON files."""
    out: Path


def main(options: Options) -> None:
    """Draw a panel for each cost, and in it a point for each way."""
    cases = load_cases(options.figures)
    figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.0), sharey=True, layout="constrained")
    for axes, (key, label) in zip(panels, COSTS.items(), strict=True):
        for i, (name, row) in enumerate(cases.items()):
            stood = 100.0 * row["stood"] / row["n"]
            low, high = (100.0 * bound for bound in row["stood_interval_95"])
            axes.errorbar(
                [row[key]["p95"]],
                [stood],
                yerr=[[stood - low], [high - stood]],
                fmt="o",
                capsize=3,
                color=f"C{i}",
                label=f"{name}: {row['stood']} of {row['n']}",
            )
        axes.set_xlabel(f"{label}: no more in 95 % of falls")
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("stood [%], with 95 % interval")
    panels[0].legend(loc="lower left")
    figure.savefig(options.out, dpi=120)


def load_cases(files: tuple[Path, ...]) -> dict[str, dict[str, Any]]:
    """Load the figures of each way, by its name."""
    cases: dict[str, dict[str, Any]] = {}
    for file in files:
        record = json.loads(file.read_text("utf-8"))
        if record["name"] == "eval":
            (cases[record["policy"]],) = (case["all"] for case in record["cases"].values())
        else:
            cases |= record["cases"]
    return cases


if __name__ == "__main__":
    main(tyro.cli(Options, config=(tyro.conf.OmitArgPrefixes,)))
