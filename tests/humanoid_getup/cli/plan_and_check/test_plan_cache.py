"""`getup rise` begins with a kept plan; `getup plan-cache` lists and clears what is kept."""

import json
from pathlib import Path

import pytest

from humanoid_getup.cli.main import main
from humanoid_getup.strategies.cache.plan_cache import PlanCache

TIMES = {"plan_s", "filter_s", "busy_p99_s", "late_p99_s", "overruns"}
HOW = {"plan_cache", "rollouts", "rounds", "searched_s", "rollout"}


def rise(start: str, out: Path, *arguments: str) -> dict:
    file = out / "report.json"
    assert main(["rise", "--from", start, "--seed", "4", "--json", str(file), *arguments]) == 0
    return json.loads(file.read_text())


@pytest.fixture(params=["stored", pytest.param("planned", marks=pytest.mark.slow)])
def start(request: pytest.FixtureRequest, lying: str) -> str:
    """Where the robot lies: where a stored motion begins, or anywhere, and is planned for."""
    if request.param == "planned":
        return "prone"
    request.getfixturevalue("stored_plans")
    return lying


def test_the_same_command_again_differs_in_how_its_plan_came_about_alone(
    start: str, plan_cache_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert rise(start, tmp_path, "--no-plan-cache")["plan_cache"] is None
    assert not plan_cache_folder.exists()
    first = rise(start, tmp_path)
    assert first["plan_cache"] is None
    capsys.readouterr()
    again = rise(start, tmp_path)
    assert "stored plan from a start" in capsys.readouterr().out
    assert {key for key in first if first[key] != again[key]} <= TIMES | HOW
    assert again["plan_cache"]["joint_rad"] == 0.0
    assert again["rollouts"] == 1

    assert main(["plan-cache", "--json", "-"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed["folder"] == str(plan_cache_folder)
    (row,) = listed["entries"]
    assert row["name"] == again["plan_cache"]["entry"]
    assert (row["robot"], row["scene"], row["start_class"]) == ("op3", "flat", "prone")
    assert (row["torque_limit_nm"], row["limit_by"]) == (None, "current")
    assert row["robust"] == first["robust"]
    assert row["stand_time_s"] == pytest.approx(first["stand_time_s"], abs=0.5)
    assert 50_000 < row["bytes"] < 500_000

    (entry,) = PlanCache(plan_cache_folder).read().entries
    entry.motion_file.write_bytes(b"")
    assert rise(start, tmp_path)["plan_cache"] is None  # planned again, and the entry replaced
    message = [line for line in capsys.readouterr().err.splitlines() if line.startswith("getup:")]
    assert len(message) == 1
    assert str(entry.motion_file) in message[0]
    assert "ignored" in message[0]
    assert PlanCache(plan_cache_folder).find_problems() == []


def test_plans_go_to_the_folder_that_is_named_and_are_cleared_from_it(
    start: str, plan_cache_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = tmp_path / "plans"
    rise(start, tmp_path, "--cache-folder", str(folder))
    assert not plan_cache_folder.exists()
    capsys.readouterr()
    assert main(["plan-cache", "--cache-folder", str(folder)]) == 0
    text = capsys.readouterr().out
    assert "prone" in text
    assert "1 solved rise, 0.1 MB" in text
    assert main(["plan-cache", "--cache-folder", str(folder), "--robot", "human", "--clear"]) == 0
    assert capsys.readouterr().out.startswith("0 rises removed")
    assert main(["plan-cache", "--cache-folder", str(folder), "--clear"]) == 0
    assert capsys.readouterr().out.startswith("1 rise removed")
    assert main(["plan-cache", "--cache-folder", str(folder), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["entries"] == []


def test_a_raw_path_is_neither_kept_nor_replaced_by_a_kept_plan(
    lying: str, plan_cache_folder: Path, tmp_path: Path
):
    file = tmp_path / "report.json"
    command = ["rise", "--from", lying, "--no-filtering", "--attempts", "1", "--json", str(file)]
    assert main(command) in (0, 1)
    assert json.loads(file.read_text())["filtering"] is False
    assert not plan_cache_folder.exists()
