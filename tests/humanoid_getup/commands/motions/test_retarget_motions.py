"""`getup motions retarget`: keys and motions of OP3 in the folder of another robot."""

from pathlib import Path

import pytest
from authored import load_robot_keyframes
from model_files import write_model
from run_getup import Run

from humanoid_getup.commands.motions import build_motions as retarget_motions
from humanoid_getup.motions.motion import Motion
from robots import Robot, load_robot
from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.robot_folder import write_robot


@pytest.fixture
def gnome(tmp_path: Path, op3: Robot) -> Path:
    """The folder of an imported robot."""
    model = write_model(tmp_path / "gnome.xml", op3)
    write_robot(import_model(model, ImportOptions(name="gnome")), tmp_path / "gnome")
    return tmp_path / "gnome"


@pytest.mark.slow  # half a minute
def test_a_motion_that_stands_is_kept_once(run: Run, gnome: Path):
    line = ("motions", "retarget", "squat_to_stand", "--robot", "gnome", "--no-improve")
    code, out, _ = run(*line)
    assert code == 0
    assert "1 of 1 stand as they are" in out
    (file,) = (gnome / "motions").iterdir()
    motion = Motion.load(file)
    assert (motion.robot, motion.end_class) == ("gnome", "standing")
    assert motion.provenance["program"] == "getup motions retarget"
    assert [each.name for each in load_robot_keyframes(load_robot(gnome))] == ["squat_to_stand"]
    before = file.read_bytes()
    code, out, _ = run(*line)
    assert code == 0
    assert "kept as they are: squat_to_stand" in out
    assert "0 of 0" not in out
    assert file.read_bytes() == before


def test_a_motion_for_each_side_without_one_can_be_built_next(
    run: Run, gnome: Path, monkeypatch: pytest.MonkeyPatch
):
    shares = {"squat_to_stand": 0.9, "supine_roll_over": 0.2}
    monkeypatch.setattr(
        retarget_motions,
        "_keep_if_standing",
        lambda _robot, keyframes, *_: shares.get(keyframes.name),
    )
    names = (*shares, "prone_push_up_gentle", "prone_push_up_fast", "supine_long_sit")
    code, out, _ = run("motions", "retarget", *names, "--robot", str(gnome), "--no-improve")
    assert code == 1
    assert out.endswith(f"; next: getup motions build prone_push_up_gentle --robot {gnome}\n")
