"""`getup bench planner` and `planner-cost`: what they write, and what they refuse."""

import json
import sys
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.benchmarks.path_planning import planner_cost
from humanoid_getup.cli.options.bench import BenchPlanner

SMALL = ("--n", "1", "--checks", "1000")
OMPL_PLANNERS = "humanoid_getup.benchmarks.path_planning.ompl_planners"


def test_planners_are_compared_and_the_table_names_them(run: Run):
    code, out, _ = run("bench", "planner", *SMALL, "--scenes", "beam", "--json", "planner.json")
    result = json.loads(Path("planner.json").read_text())
    assert (code, result["name"], result["budget_checks"]) == (0, "planner", 1000)
    planners = BenchPlanner().planners
    assert [case for case in result["cases"] if "beam" in case] == [f"beam: {p}" for p in planners]
    assert all(f"all: {planner}" in out for planner in planners)
    for record in result["problems"]:
        assert record["checks"] <= 1002  # a posture that is lifted is checked three times


def test_the_cost_is_written_and_drawn(run: Run, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(planner_cost.bench_planner_cost, "__kwdefaults__", _few())
    arguments = ("bench", "planner-cost", *SMALL, "--picture", "cost.png", "--json", "cost.json")
    code, out, _ = run(*arguments)
    result = json.loads(Path("cost.json").read_text())
    assert (code, result["name"]) == (0, "planner-cost")
    assert "20 joints, 4 obstacles" in result["cases"]
    assert "20 joints, 4 obstacles" in out
    assert Path("cost.png").stat().st_size > 10_000


def _few() -> dict:
    """The defaults of the benchmark, with fewer cases."""
    defaults = planner_cost.bench_planner_cost.__kwdefaults__
    return {**defaults, "joints": (20,), "obstacles": (0, 4)}


def test_without_ompl_one_line_tells_what_to_install(run: Run, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(
        sys.modules, "humanoid_getup.benchmarks.path_planning.ompl_planners", raising=False
    )
    monkeypatch.setitem(sys.modules, "ompl", None)
    code, out, error = run("bench", "planner", "--n", "1", "--json", "planner.json")
    assert (code, out) == (2, "")
    assert error == "getup: there is no package 'ompl': pip install 'humanoid-getup[bench]'\n"
    assert not Path("planner.json").exists()


def test_without_ompl_the_own_planners_are_compared(run: Run, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(
        sys.modules, "humanoid_getup.benchmarks.path_planning.ompl_planners", raising=False
    )
    monkeypatch.setitem(sys.modules, "ompl", None)
    own = ("--planners", "refined", "strict", "--scenes", "beam")
    assert run("bench", "planner", *SMALL, *own)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("planner", "--planners"), "--planners is empty, expected a name or more"),
        (("planner", "--scenes", "wall", "wall"), "--scenes has 'wall' twice, expected each name"),
        (("scenes", "--ways"), "--ways is empty, expected a name or more"),
        (("scenes", "--ways", "plan", "plan"), "--ways has 'plan' twice, expected each name once"),
    ],
)
def test_nothing_to_compare_or_the_same_twice_is_refused(
    run: Run, arguments: tuple[str, ...], message: str
):
    code, _, error = run("bench", *arguments)
    assert (code, error.count("\n")) == (2, 1)
    assert message in error
