"""Scripts that compare planners, measure their cost or read a training: what they print."""

import json
import sys
from pathlib import Path

import compare_planners
import measure_planner_cost
import pytest
from benchmark_scripts import load_script


@pytest.fixture(autouse=True)
def wide_table(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "200")


def test_planners_are_compared_and_the_table_names_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    file = tmp_path / "planner.json"
    compare_planners.main(n=1, checks=1000, scenes=("beam",), json=file)
    result, out = json.loads(file.read_text()), capsys.readouterr().out
    assert (result["name"], result["budget_checks"]) == ("planner", 1000)
    planners = compare_planners.PLANNERS
    assert [case for case in result["cases"] if "beam" in case] == [f"beam: {p}" for p in planners]
    assert all(f"all: {planner}" in out for planner in planners)
    assert len(result["problems"]) == len(planners)
    # A posture that is lifted is checked three times.
    assert max(record["checks"] for record in result["problems"]) <= 1002


def test_the_cost_is_written_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file, picture = tmp_path / "cost.json", tmp_path / "cost.png"
    measure_planner_cost.main(
        n=1, checks=1000, joints=(20,), obstacles=(0, 4), picture=picture, json=file
    )
    result = json.loads(file.read_text())
    assert result["name"] == "planner-cost"
    assert "20 joints, 4 obstacles" in result["cases"]
    assert "20 joints, 4 obstacles" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000


def test_the_own_planners_need_no_ompl(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(sys.modules, "path_planning.ompl_planners", raising=False)
    monkeypatch.setitem(sys.modules, "ompl", None)
    assert list(compare_planners.find_planners(("refined", "strict"))) == ["refined", "strict"]
    with pytest.raises(ModuleNotFoundError, match="ompl"):
        compare_planners.find_planners(("RRTConnect",))


@pytest.fixture
def progress(tmp_path: Path):
    """Read 60 iterations of 2 s and 100 steps; from the 30th on, all of the 10 falls stand."""
    rows = [f"{2.0 * (i + 1)},{100 * (i + 1)},10,{10 if i >= 30 else 0}" for i in range(60)]
    lines = "\n".join(["seconds,steps,falls,stood", *rows])
    (tmp_path / "progress.csv").write_text(lines + "\n", "utf-8")
    return load_script("training_progress").TrainingProgress.read(tmp_path)


def test_speed_is_counted_from_an_iteration_on_and_a_share_of_the_last_falls(progress):
    assert progress.steps_per_s(begin=1) == 50.0
    # 12 of the last 15 iterations are from the 30th on at the 42nd.
    assert progress.share[[29, 41, 44]] == pytest.approx([0.0, 0.8, 1.0])
