"""Compare the speed of two checkouts: the same benchmarks in turn, the ratio pair by pair.

Both run with this interpreter, one process at a time, so that a drift of the machine's speed meets
both. The first pair warms the disk up and is not counted.

    python benchmarks/beside_base.py --base ../base --n 5 --json beside.json
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

HERE = Path(__file__).parents[1]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Compare the speed of this checkout with that of another one."""

    base: Path
    """The other checkout."""
    n: int = 5
    """Pairs of each benchmark."""
    only: tuple[str, ...] = ()
    """Benchmarks to run; none for all."""
    json: Path | None = None
    """Where figures are written."""


def run(tree: Path, arguments: list[str]) -> str:
    """Run Python in a checkout and return what it prints."""
    environment = os.environ | {"PYTHONPATH": str(tree.resolve())}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=tree, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(f"{tree}: {' '.join(arguments)} failed:\n{done.stderr}")
    return done.stdout


def run_for_json(tree: Path, arguments: list[str]) -> dict[str, Any]:
    """Run a benchmark in a checkout and return what it writes to `--json`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "figures.json")
        run(tree, [*arguments, "--json", str(file)])
        return json.loads(file.read_text("utf-8"))


def time_training(tree: Path) -> dict[str, float]:
    """Measure steps a second of environment and training; bare physics is the yardstick."""
    sizes = ["--robots", "256", "--falls", "24", "--iterations", "2", "--peer-iterations", "1"]
    rates = run_for_json(tree, ["benchmarks/train_throughput.py", *sizes])["policy_steps_per_s"]
    return {
        "bare physics [policy steps/s]": rates["bare"],
        "environment [policy steps/s]": rates["env"],
        "environment over bare physics": rates["env"] / rates["bare"],
        "training [policy steps/s]": rates["training"],
    }


def time_filter(tree: Path) -> dict[str, float]:
    """Measure the filter's simulation steps a second over those of bare physics."""
    project = tomllib.loads((tree / "pyproject.toml").read_text("utf-8"))["project"]
    module, function = project["scripts"]["getup"].split(":")
    program = f"import sys; from {module} import {function}; sys.exit({function}())"
    result = run_for_json(tree, ["-c", program, "bench", "filter", "--n", "2"])
    rate = result["cases"]["one_thread"]["filter_over_bare_steps_per_s"]
    return {"filter rollouts over bare physics, one thread": rate}


def time_policy(tree: Path) -> dict[str, float]:
    """Measure the cycles of a policy; as a rate, so that more is better."""
    policy = "robots/op3/policies/robust.onnx"
    printed = run(tree, ["benchmarks/policy_step.py", policy, "--steps", "500"])
    figures = json.loads(printed)
    return {
        "policy: cycles that decide [1/s]": 1e3 / figures["deciding_cycle_median_ms"],
        "policy: all cycles [1/s]": 1e3 / figures["mean_cycle_median_ms"],
    }


def time_bus(tree: Path) -> dict[str, float]:
    """Measure cycles a second on the virtual bus at 2 Mbps, and per second of processor time."""
    arguments = ["benchmarks/bus_cycle.py", "--cycles", "300", "--bauds", "2000000"]
    cases = run_for_json(tree, arguments)["cases"]
    case = next(case for name, case in cases.items() if name.startswith("ours, guarded"))
    return {
        "bus cycles at 2 Mbps [1/s]": 1e6 / case["cycle_us"],
        "bus cycles [1/s of processor time]": 1e6 / case["processor_us"],
    }


BENCHMARKS: dict[str, Callable[[Path], dict[str, float]]] = {
    "policy": time_policy,
    "filter": time_filter,
    "bus": time_bus,
    "training": time_training,
}


def main(options: Options) -> None:
    """Measure, print, write."""
    rows: dict[str, dict[str, Any]] = {}
    for name in options.only or BENCHMARKS:
        pairs = []
        for _ in range(options.n + 1):
            load = os.getloadavg()[0]
            pairs.append((BENCHMARKS[name](HERE), BENCHMARKS[name](options.base), load))
        for figure in pairs[0][0]:
            ours = np.array([pair[0][figure] for pair in pairs[1:]])
            base = np.array([pair[1][figure] for pair in pairs[1:]])
            ratio = ours / base
            rows[figure] = {
                "n": options.n,
                "median": float(np.median(ours)),
                "base_median": float(np.median(base)),
                "ratio": {
                    "median": float(np.median(ratio)),
                    "min": float(ratio.min()),
                    "max": float(ratio.max()),
                },
                "load": float(np.median([pair[2] for pair in pairs[1:]])),
            }
            print(
                f"{figure:48} {rows[figure]['median']:9.4g} / {rows[figure]['base_median']:9.4g}"
                f" = {np.median(ratio):5.2f} ({ratio.min():.2f} to {ratio.max():.2f}),"
                f" load {rows[figure]['load']:.1f}",
                flush=True,
            )
    if options.json is not None:
        record = {"name": "beside_base", "n": options.n, "cases": rows}
        write_atomically(options.json, to_json(record))


if __name__ == "__main__":
    main(tyro.cli(Options))
