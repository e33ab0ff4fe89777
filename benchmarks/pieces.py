"""Overhead of engines: pieces that do nothing, as many and as large as those of a benchmark.

    python benchmarks/pieces.py --engines local:1 local:2 ray:2 dask:2 --json pieces.json

Each piece carries and returns as many bytes as a rise of `getup bench rise`, is checked for its
versions, and is kept in a ledger. *Start* is the time from the request to the first result.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from json import dumps, loads
from pathlib import Path

import tyro

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.run_pieces import run_pieces, start_workers
from humanoid_getup.engines.versions import CheckedWork, Versions
from humanoid_getup.progress.ledger import Ledger

ENGINES = ("local:1", "local:2", "ray:2", "dask:2")
COUNTS = (1, 10, 100, 1000, 10_000)
CARRIED = "x" * 1500  # bytes: a fall and a seed carry 1.4 kB, the figures of a rise 1.3 kB


def echo(piece: str) -> str:
    """Return a piece."""
    return piece


def measure(engine: str, count: int) -> dict[str, float]:
    """Run pieces in this process; return times [s] and its largest memory [MiB]."""
    versions = Versions.find("op3")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    arrived = list[float]()
    with tempfile.TemporaryDirectory() as folder:
        ledger = Ledger(Path(folder, "ledger.jsonl"), {"seed": 0})

        def end(name: str, result: str) -> None:
            arrived.append(time.perf_counter() - began)
            ledger.add(name, result)

        pieces = {str(number): CARRIED for number in range(count)}
        with start_workers(Engine.parse(engine), count) as workers:
            run_pieces(CheckedWork(echo, "op3", versions), pieces, workers, end)
            ended = time.perf_counter() - began
        size = ledger.path.stat().st_size
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "n": count,
        "start_s": arrived[0],
        "piece_ms": 1e3 * (arrived[-1] - arrived[0]) / max(count - 1, 1),
        "pieces_s": ended,
        "all_s": time.perf_counter() - began,
        "memory_mib": (after - before) / 1024.0,
        "ledger_mib": size / 2**20,
    }


def main(
    *,
    engines: tuple[str, ...] = ENGINES,
    counts: tuple[int, ...] = COUNTS,
    one: bool = False,
    json: Path | None = None,
) -> None:
    """Measure each engine with each number of pieces, in a fresh process.

    Args:
        engines: Engines, as `--engine` takes them.
        counts: Numbers of pieces.
        one: Measure the first of both in this process, and print its figures as JSON.
        json: File for the results.
    """
    if one:
        print(dumps(measure(engines[0], counts[0])))
        return
    cases = dict[str, dict[str, float]]()
    for engine in engines:
        for count in counts:
            words = [sys.executable, __file__, "--one", "--engines", engine, "--counts", str(count)]
            done = subprocess.run(words, capture_output=True, text=True, check=True)
            found = loads(done.stdout.splitlines()[-1])
            cases[f"{engine}, {count}"] = found
            figures = ", ".join(f"{key} {value:.4g}" for key, value in found.items())
            print(f"{engine:8} {figures}", flush=True)
    if json:
        json.write_text(dumps({"name": "pieces", "cases": cases}, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
