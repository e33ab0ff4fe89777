"""`getup plan`, and key postures of `getup rise`: files, figures and exit codes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanoid_getup.commands.main import main
from humanoid_getup.experiments.starts.falls import sample_fall
from humanoid_getup.motions.key_posture import load_key
from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.description.posture_file import format_posture

KEY = "motions:supine_sit_up_gentle@1.2"


def run(*arguments: str, file: Path) -> tuple[int, dict[str, Any]]:
    code = main([*arguments, "--json", str(file)])
    return code, json.loads(file.read_text())


@pytest.fixture(scope="module")
def out(lying: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a plan, with its figures."""
    out = tmp_path_factory.mktemp("plan") / "out"
    file = out.parent / "plan.json"
    assert main(["plan", "--from", lying, "--out", str(out), "--json", str(file)]) == 0
    return out


@pytest.fixture(scope="module")
def short(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The arguments of a search that ends before it finds a path: beside a wall."""
    file = tmp_path_factory.mktemp("wall") / "right.json"
    fall = sample_fall(World(op3, "wall"), "right", seed=2)
    file.write_text(format_posture(fall.posture, op3))
    return ["plan", "--from", str(file), "--scene", "wall", "--seed", "6", "--max-checks", "100"]


def test_a_path_is_found_saved_and_described(out: Path, op3: Robot):
    record = json.loads((out.parent / "plan.json").read_text())
    path = Motion.load(out / "path.npz")
    assert {file.name for file in out.iterdir()} >= {"path.npz"}
    assert (record["strip_reason"] is None) == (out / "strip.png").exists()
    assert record["found"]
    assert (record["status"], record["reason"]) == ("reached the goal", "")
    assert record["connection"]["motion"] == record["goal"] == record["tried"][-1]["goal"]
    assert record["duration_s"] == pytest.approx(path.duration)
    assert record["checks"] > 0
    assert not record["refined"]
    assert (path.end_class, path.rises) == ("other", False)
    connection = record["connection"]
    joined = load_key(f"motions:{connection['motion']}@{connection['time_s']}", op3)
    np.testing.assert_allclose(path.joint_pos[-1], joined.posture.joint_pos, atol=1e-9)


@pytest.mark.usefixtures("no_film")
def test_a_path_leads_through_keys_to_a_posture(lying: str, tmp_path: Path, op3: Robot):
    wanted = ["--key", KEY, "--to", "motions:squat_to_stand@0"]
    code, record = run(
        "plan", "--from", lying, *wanted, "--out", str(tmp_path), file=tmp_path / "plan.json"
    )
    path = Motion.load(tmp_path / "path.npz")
    (key,) = record["keys"]
    assert code == 0
    assert record["connection"] is None
    assert record["goal"] == "motions:squat_to_stand@0"
    at = int(np.argmin(np.abs(path.time - key["time_s"])))
    np.testing.assert_allclose(path.joint_pos[at], load_key(KEY, op3).posture.joint_pos, atol=1e-9)


def test_a_spent_budget_is_one_line_that_says_what_where_and_when(
    short: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "out"
    assert main([*short, "--out", str(out)]) == 1
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    for part in ("no path to", "checks in", "mm inside", "% of the path", "at looseness"):
        assert part in printed
    assert not out.exists() or list(out.iterdir()) == []


@pytest.mark.usefixtures("no_film")
def test_the_beginning_of_the_best_path_is_kept_on_request(short: list[str], tmp_path: Path):
    code, record = run(
        *short, "--keep-partial", "--out", str(tmp_path), file=tmp_path / "plan.json"
    )
    path = Motion.load(tmp_path / "path.npz")
    assert (code, record["found"], record["refined"]) == (1, False, True)
    assert len(record["tried"]) == 6
    assert path.provenance["complete"] == 0
    assert 0.0 < record["duration_s"] == pytest.approx(path.duration)


@pytest.mark.usefixtures("no_film")
def test_from_under_a_table_the_path_leads_out_first(tmp_path: Path):
    arguments = ["plan", "--from", "right", "--scene", "table", "--seed", "10"]
    code, record = run(*arguments, "--out", str(tmp_path), file=tmp_path / "plan.json")
    path = Motion.load(tmp_path / "path.npz")
    assert (code, record["found"]) == (0, True)
    moved = np.linalg.norm(path.position - path.position[0], axis=1)
    bends = int(np.flatnonzero(np.any(path.joint_pos != path.joint_pos[0], axis=1))[0])
    assert moved[bends - 1] == pytest.approx(record["way_out_m"], rel=0.3)
    assert record["way_out_m"] > 0.3


@pytest.mark.usefixtures("no_film")
def test_a_path_of_another_body_says_so_and_is_refused_by_the_original(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    arguments = ["plan", "--from", "supine", "--body", "arms=1.6", "--out", str(tmp_path)]
    assert main(arguments) == 0
    assert Motion.load(tmp_path / "path.npz").provenance["body"] == "arms=1.6"
    assert main(["preflight", str(tmp_path / "path.npz")]) == 2
    assert "arms=1.6" in capsys.readouterr().err
