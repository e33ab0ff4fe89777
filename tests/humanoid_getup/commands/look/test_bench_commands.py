"""`getup bench`: a page, and rises that are the same on every engine and after an interrupt."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from rise_figures_of import drop_wall_times, read_rises
from run_getup import Run

from humanoid_getup.benchmarks import rise
from humanoid_getup.commands.look.bench_rise import BenchRise, benchmark
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot
from robots.storage.encoding import to_json

QUICK: dict[str, Any] = {"n": 1, "seed": 4, "planning": False, "filtering": False}


def rise_by(**options: Any) -> list[dict[str, Any]]:
    return read_rises(to_json(benchmark(BenchRise(**QUICK, **options))))


def test_a_robot_that_can_do_nothing_gets_a_page_that_says_so(own_robot: Path, run: Run):
    arguments = ("bench", "all", "--robot", str(own_robot), "--quick", "--out", "all")
    code, out, _ = run(*arguments, "--json", "-")
    assert code == 0
    page, result = Path("all/benchmark.md").read_text(), json.loads(out)
    assert "Robot 'tiny' has no motions" in page
    assert "Robot 'tiny' has no policies" in page
    assert "2 × XM430-W350" in page
    assert (result["cases"], result["n"]) == ({}, 4)
    assert result == json.loads(Path("all/benchmark.json").read_text()) | {"body": ""}
    assert f"getup bench all --robot {own_robot} --n 4 --seed 0 --quick\n" in page


@pytest.mark.slow
def test_a_run_is_resumed_and_ends_the_same(op3: Robot, tmp_path: Path, run: Run):
    folder = tmp_path / "mine"
    shutil.copytree(op3.folder, folder)
    for file in (*folder.glob("policies/*"), *folder.glob("motions/*")):
        if file.stem != "prone_push_up_gentle":
            file.unlink()
    arguments = ("bench", "all", "--robot", str(folder), "--quick", "--n", "1", "--out", "all")
    assert run(*arguments)[0] == 0
    first, ledger = Path("all/benchmark.json").read_text(), Path("all/benchmark.jsonl")
    pieces = ledger.read_bytes().splitlines(keepends=True)
    assert len(pieces) == 1 + 2 * 2 * 4  # 2 ways, 2 caps, 4 falls
    ledger.write_bytes(b"".join(pieces[:-2]))
    code, out, _ = run(*arguments, "--resume")
    assert code == 0
    assert "14 of 16 rises are finished" in out
    assert ledger.read_bytes().startswith(b"".join(pieces[:-2]))
    again = json.loads(Path("all/benchmark.json").read_text())
    assert drop_wall_times(again) == drop_wall_times(json.loads(first))
    code, _, error = run(*arguments, "--resume", "--seed", "1")
    assert code == 2
    assert "made with another seed (0, now 1)" in error


@pytest.mark.slow
@pytest.mark.usefixtures("no_film")
def test_workers_measure_what_one_process_measures(op3: Robot, tmp_path: Path, run: Run):
    hidden = shutil.ignore_patterns(
        "motions", *(f"{name}.onnx" for name in ("gentle", "quick", "styled"))
    )
    shutil.copytree(op3.folder, tmp_path / "mine", ignore=hidden)
    arguments = ("bench", "all", "--robot", str(tmp_path / "mine"), "--quick", "--n", "1", "--out")
    cases = []
    for out, engine in (("here", "local:1"), ("there", "local:2")):
        assert run(*arguments, out, "--engine", engine)[0] == 0
        cases.append(drop_wall_times(json.loads(Path(out, "benchmark.json").read_text()))["cases"])
    assert len(cases[0]) == 2
    assert cases[1] == cases[0]


def test_interrupted_rises_are_resumed_from_their_ledger(monkeypatch: pytest.MonkeyPatch, run: Run):
    """Of robots that stay where they lie."""
    risen = list[int]()

    def stay(strategy: PlannedRise, piece: rise.RisePiece) -> Rise:
        risen.append(piece.number)
        if len(risen) == 6:
            raise KeyboardInterrupt
        return Rise(
            robot=strategy.world.robot,
            start_class=piece.fall.start_class,
            status=AttemptStatus.NEEDS_HELP,
            reason=f"{piece.number}",
        )

    monkeypatch.setattr(rise, "rise_from", stay)
    here = rise_by(engine="local:1")
    line = ("bench", "rise", "--n", "1", "--seed", "4", "--no-planning", "--no-filtering")
    kept = (*line, "--ledger", "ledger")
    code, _, error = run(*kept)
    assert code == 130
    assert error.splitlines()[-1].endswith("--ledger ledger --resume continues")
    code, out, _ = run(*kept, "--resume", "--json", "resumed.json")
    assert code == 0
    assert "2 rises are finished" in out
    assert risen == [0, 1, 2, 0, 1, 2, 2]
    assert read_rises(Path("resumed.json").read_text()) == here
    code, _, error = run(*kept, "--resume", "--torque-limit", "3")
    assert code == 2
    assert "made with another torque_limit_nm" in error
    code, _, error = run(*line, "--resume")
    assert code == 2
    assert "--resume is given without --ledger" in error


@pytest.mark.scale
def test_workers_give_what_this_process_gives():
    here = rise_by(engine="local:1")
    assert len(here) == 3
    assert rise_by(engine="local:2") == here
    pytest.importorskip("distributed")
    assert rise_by(engine="dask:2") == here
