"""`getup robots check`: lines, exit codes, JSON, the picture."""

import json
from pathlib import Path

import pytest
from run_getup import Run
from spoiling import spoil

from humanoid_getup.reporting.film_strip import NoRendererError, render_frames
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place


@pytest.fixture
def copied_op3(tmp_path: Path, op3: Robot) -> Path:
    """A folder of OP3 without motions and policies."""
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in ("robot.toml", "model.xml"):
        (folder / name).write_text((op3.folder / name).read_text("utf-8"), "utf-8")
    return folder


def test_all_is_well_with_op3_and_each_finding_is_a_line(run: Run):
    code, out, error = run("robots", "check", "op3")
    assert (code, error) == (0, "")
    lines = out.splitlines()
    assert len(lines) == 12
    assert all(line.startswith("ok ") for line in lines)


@pytest.mark.usefixtures("copied_op3")
def test_a_folder_is_checked_and_the_next_step_is_shown(run: Run):
    code, out, _ = run("robots", "check", "mine", "--json", "found.json")
    assert code == 0
    assert "(getup motions discover --robot mine)" in out
    found = json.loads(Path("found.json").read_text())
    assert found["robot"] == "op3"
    assert found["unchecked"] == []
    levels = [finding["level"] for finding in found["findings"]]
    assert levels.count("warning") == 1
    assert set(found["findings"][0]) == {"level", "subject", "text", "remedy"}


def test_a_fault_ends_with_1_and_tells_what_was_not_checked(run: Run, copied_op3: Path):
    for side in "lr":
        old = f'mirror = "{side}_knee", mirror_sign = -1'
        spoil(copied_op3, old, old.replace("-1", "1"))
    code, out, _ = run("robots", "check", str(copied_op3))
    assert code == 1
    assert out.count("fault ") == 1
    assert "not checked until the faults are corrected: squats, strength, arms, holding" in out


def test_stance_and_deepest_squat_are_drawn(run: Run, op3: Robot, world: World, tmp_path: Path):
    try:
        render_frames(op3, world.model, place(op3, world.model, op3.standing)[None])
    except NoRendererError:
        pytest.skip("there is no GL")
    code, out, _ = run("robots", "check", "op3", "--picture", "op3.png")
    assert code == 0
    assert out.endswith("picture in op3.png\n")
    assert (tmp_path / "op3.png").read_bytes().startswith(b"\x89PNG")
