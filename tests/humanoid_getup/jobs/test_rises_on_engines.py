"""The rises of a benchmark are the same on every engine, whatever happens to its workers."""

import os
import signal
import threading
import time
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest
from rise_figures_of import read_rises

from humanoid_getup.jobs.benchmark import benchmark
from humanoid_getup.jobs.requests.bench import BenchRise
from humanoid_getup.progress.callback import CancelledError
from robots.storage.encoding import to_json

QUICK: dict[str, Any] = {"n": 1, "seed": 4, "planning": False, "filtering": False}


@pytest.fixture(scope="module")
def here() -> list[dict[str, Any]]:
    """Rise in this process."""
    return read_rises(to_json(benchmark(BenchRise(engine="local:1", **QUICK))))


@pytest.mark.parametrize("engine", ["local:2", pytest.param("dask:2", marks=pytest.mark.scale)])
def test_workers_give_what_this_process_gives(here: list[dict[str, Any]], engine: str):
    pytest.importorskip("distributed" if engine == "dask:2" else "mujoco")
    assert len(here) == 3
    assert read_rises(to_json(benchmark(BenchRise(engine=engine, **QUICK)))) == here


def test_a_killed_process_changes_nothing(here: list[dict[str, Any]]):
    killed = threading.Event()

    def kill_one() -> None:
        while len(started := active_children()) < 2:
            time.sleep(0.01)
        os.kill(started[0].pid or 0, signal.SIGKILL)
        killed.set()

    threading.Thread(target=kill_one, daemon=True).start()
    found = read_rises(to_json(benchmark(BenchRise(engine="local:2", **QUICK))))
    assert killed.is_set()
    assert found == here


def test_a_ledger_goes_on_with_another_engine(here: list[dict[str, Any]], tmp_path: Path):
    ledger = tmp_path / "rises.jsonl"
    shown = list[float]()

    with pytest.raises(CancelledError):
        benchmark(
            BenchRise(engine="local:1", ledger=ledger, **QUICK),
            lambda progress: shown.append(progress.done),
            lambda: 2.0 in shown,
        )
    assert len(ledger.read_text().splitlines()) == 1 + 2
    rest = BenchRise(engine="local:2", ledger=ledger, resume=True, **QUICK)
    assert read_rises(to_json(benchmark(rest))) == here
