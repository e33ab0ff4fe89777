"""`getup bench all`, as a person runs it."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from rise_figures_of import WALL_TIMES, read_rises
from run_getup import Run

from humanoid_getup.benchmarks import rise
from humanoid_getup.execution.result import RiseResult
from robots import Robot


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
    assert len(pieces) == 1 + 2 * 2 * 4 + 1 + 4  # 2 ways, 2 caps; a motion; falls
    ledger.write_bytes(b"".join(pieces[:-2]))
    code, out, _ = run(*arguments, "--resume")
    assert code == 0
    assert "19 of 21 pieces are finished" in out
    assert ledger.read_bytes().startswith(b"".join(pieces[:-2]))
    again = json.loads(Path("all/benchmark.json").read_text())
    assert without_wall_time(again) == without_wall_time(json.loads(first))
    code, _, error = run(*arguments, "--resume", "--seed", "1")
    assert code == 2
    assert "made with another seed (0, now 1)" in error


@pytest.mark.slow
@pytest.mark.usefixtures("no_film")
def test_workers_measure_what_one_process_measures(op3: Robot, tmp_path: Path, run: Run):
    folder = tmp_path / "mine"
    shutil.copytree(op3.folder, folder)
    shutil.rmtree(folder / "motions")
    for file in folder.glob("policies/*"):
        if file.stem != "robust":
            file.unlink()
    arguments = ("bench", "all", "--robot", str(folder), "--quick", "--n", "1", "--out")
    assert run(*arguments, "here", "--engine", "local:1")[0] == 0
    assert run(*arguments, "there", "--engine", "local:2")[0] == 0
    here, there = (
        without_wall_time(json.loads(Path(out, "benchmark.json").read_text()))
        for out in ("here", "there")
    )
    assert len(here["cases"]) == 2
    assert there["cases"] == here["cases"]


def without_wall_time(value):
    """Remove what depends on the machine."""
    if isinstance(value, dict):
        kept = {key: item for key, item in value.items() if key not in WALL_TIMES}
        return {key: without_wall_time(item) for key, item in kept.items()}
    return value


def test_interrupted_rises_are_resumed_from_their_ledger(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
):
    ledger, whole, resumed = (tmp_path / name for name in ("ledger.json", "a.json", "b.json"))
    line = ("bench", "rise", "--n", "1", "--seed", "4", "--no-planning", "--no-filtering")
    assert run(*line, "--json", str(whole))[0] == 0
    rise_from, risen = rise.rise_from, []

    def interrupt_the_third(*args: Any, **options: Any) -> RiseResult:
        risen.append(args[1].number)
        if len(risen) == 3:
            raise KeyboardInterrupt
        return rise_from(*args, **options)

    monkeypatch.setattr(rise, "rise_from", interrupt_the_third)
    kept = (*line, "--ledger", str(ledger))
    code, _, error = run(*kept)
    assert code == 130
    assert error.splitlines()[-1].endswith(f"--ledger {ledger} --resume continues")
    code, out, _ = run(*kept, "--resume", "--json", str(resumed))
    assert code == 0
    assert "2 rises are finished" in out
    assert risen == [0, 1, 2, 2]
    assert read_rises(resumed.read_text()) == read_rises(whole.read_text())
    code, _, error = run(*kept, "--resume", "--torque-limit", "3")
    assert code == 2
    assert "made with another torque_limit_nm" in error
    code, _, error = run(*line, "--resume")
    assert code == 2
    assert "--resume is given without --ledger" in error
