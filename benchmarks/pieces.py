"""Overhead of engines: pieces that do nothing, as many and as large as those of a benchmark.

    python benchmarks/pieces.py --engines local:1 local:2 dask:2 --json pieces.json

Each piece carries and returns as many bytes as a rise of `getup bench rise`, and is kept in a
ledger. *Start* is the time from the request to the first result.
"""

from __future__ import annotations

import tempfile
import time
from json import dumps
from pathlib import Path

import tyro

from humanoid_getup.engines.executor import do_pieces, make_executor
from humanoid_getup.engines.versions import checked
from humanoid_getup.progress.ledger import Ledger

ENGINES = ("local:1", "local:2", "dask:2")
COUNTS = (1, 100, 1000, 10_000)
CARRIED = "x" * 1500  # bytes: a fall and a seed carry 1.4 kB, the figures of a rise 1.3 kB


def echo(piece: str) -> str:
    """Return a piece."""
    return piece


def measure(engine: str, count: int) -> dict[str, float]:
    """Do pieces; return times [s]."""
    began, arrived = time.perf_counter(), list[float]()

    def note(_name: str, _result: str) -> None:
        arrived.append(time.perf_counter() - began)

    pieces = {str(number): CARRIED for number in range(count)}
    with tempfile.TemporaryDirectory() as folder:
        ledger = Ledger(Path(folder, "ledger.jsonl"), {"seed": 0})
        with make_executor(engine, pieces=count) as executor:
            work = checked(echo, executor, "op3")
            do_pieces(work, pieces, executor, ledger=ledger, ended=note)
    return {
        "n": count,
        "start_s": arrived[0],
        "piece_ms": 1e3 * (arrived[-1] - arrived[0]) / max(count - 1, 1),
        "all_s": time.perf_counter() - began,
    }


def main(
    *,
    engines: tuple[str, ...] = ENGINES,
    counts: tuple[int, ...] = COUNTS,
    json: Path | None = None,
) -> None:
    """Measure each engine with each number of pieces.

    Args:
        engines: Engines, as `--engine` takes them.
        counts: Numbers of pieces.
        json: File for the results.
    """
    cases = dict[str, dict[str, float]]()
    for engine in engines:
        for count in counts:
            found = cases[f"{engine}, {count}"] = measure(engine, count)
            figures = ", ".join(f"{key} {value:.4g}" for key, value in found.items())
            print(f"{engine:8} {figures}", flush=True)
    if json:
        json.write_text(dumps({"name": "pieces", "cases": cases}, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
