"""`getup plan`: files, figures and exit codes of paths."""

import json
from pathlib import Path

import numpy as np
import pytest
from run_getup import Run

from humanoid_getup.commands.plan.plan_path import PlanRequest, plan
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_key
from robots import Posture, Robot
from robots.description.posture_file import format_posture

KEY = "motions:supine_sit_up_gentle@1.2"


def test_a_path_is_found_saved_and_described(run: Run, lying: str, op3: Robot, tmp_path: Path):
    assert run("plan", "--from", lying, "--out", "out", "--json", "plan.json")[0] == 0
    record = json.loads((tmp_path / "plan.json").read_text())
    path = Motion.load(tmp_path / "out" / "path.npz")
    assert (record["strip_reason"] is None) == (tmp_path / "out" / "strip.png").exists()
    assert record["found"]
    assert (record["status"], record["reason"]) == ("reached the goal", "")
    connection = record["connection"]
    assert connection["motion"] == record["goal"] == record["tried"][-1]["goal"]
    assert record["duration_s"] == pytest.approx(path.duration)
    assert record["checks"] > 0
    assert not record["refined"]
    assert (path.end_class, path.rises) == ("other", False)
    joined = load_key(f"motions:{connection['motion']}@{connection['time_s']}", op3)
    np.testing.assert_allclose(path.joint_pos[-1], joined.posture.joint_pos, atol=1e-9)


def test_a_path_leads_through_keys_to_a_posture(lying: str, op3: Robot):
    found = plan(PlanRequest(origin=lying, key=(KEY,), to="motions:squat_to_stand@0"))
    path, goal = found.answer.trajectory, found.answer.goal
    assert path is not None
    assert (goal.name, goal.connection) == ("motions:squat_to_stand@0", None)
    (passed,) = found.describe()["keys"]
    at = int(np.argmin(np.abs(path.time - passed["time_s"])))
    np.testing.assert_allclose(path.joint_pos[at], load_key(KEY, op3).posture.joint_pos, atol=1e-9)


def test_a_spent_budget_is_one_line_that_says_what_where_and_when(
    run: Run, op3: Robot, supine: Posture
):
    Path("supine.json").write_text(format_posture(supine, op3))
    code, out, _ = run("plan", "--from", "supine.json", "--max-checks", "30", "--out", "out")
    assert (code, out.count("\n")) == (1, 1)
    for part in ("no path to", "checks in", "mm inside", "% of the path", "at looseness"):
        assert part in out
    assert list(Path("out").iterdir()) == []


def test_from_under_a_table_the_path_leads_out_first():
    found = plan(PlanRequest(origin="right", scene="table", seed=10))
    path, way_out = found.answer.trajectory, found.answer.way_out
    assert found.found and path is not None and way_out is not None
    moved = np.linalg.norm(path.position - path.position[0], axis=1)
    bends = int(np.flatnonzero(np.any(path.joint_pos != path.joint_pos[0], axis=1))[0])
    assert moved[bends - 1] == pytest.approx(way_out.length, rel=0.3)
    assert way_out.length > 0.3


@pytest.mark.usefixtures("no_film")
def test_a_path_of_another_body_says_so(tmp_path: Path):
    plan(PlanRequest(origin="supine", body="arms=1.6", out=tmp_path))
    assert Motion.load(tmp_path / "path.npz").provenance["body"] == "arms=1.6"
