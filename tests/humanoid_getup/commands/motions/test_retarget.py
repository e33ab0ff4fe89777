"""`getup motions retarget`: keys and motions of OP3 in the folder of another robot."""

import json
from pathlib import Path

import numpy as np
import pytest
from authored import load_robot_keyframes
from human_clips import PERIOD, write_human_bvh
from model_files import write_model
from run_getup import Run

from humanoid_getup.commands.motions import retarget_motions
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


def test_a_clip_becomes_a_motion_and_its_deviation_is_reported(run: Run, tmp_path):
    write_human_bvh(tmp_path / "sit up.bvh")
    message = ("mocap", "import", "sit up.bvh", "--robot", "human", "--json", "figures.json")
    code, out, error = run(*message)
    assert (code, error) == (0, "")
    assert "sit_up: " in out
    assert "from supine" in out
    assert "next: getup play sit_up.npz --robot human" in out
    motion, figures = (
        Motion.load(tmp_path / "sit_up.npz"),
        json.loads((tmp_path / "figures.json").read_text()),
    )
    human = load_robot("human")
    assert motion.robot == "human"
    assert np.diff(motion.time) == pytest.approx(human.control_period)
    assert motion.duration == pytest.approx(20 * PERIOD, rel=0.1)  # a body of about its size
    hip = human.joint_names.index("l_hip_pitch")
    assert np.degrees(motion.joint_pos[-1, hip]) == pytest.approx(-70.0, abs=2.0)
    assert figures["start_class"] == motion.start_class == "supine"
    assert figures["deviation_mean_deg"] < 2.0
    assert figures["slowdown"] == pytest.approx(1.0)


def test_with_finish_and_a_name_it_is_a_rise_that_is_written_where_asked(run: Run, tmp_path):
    write_human_bvh(tmp_path / "clip.bvh")
    code, _, _ = run(
        *("mocap", "import", "clip.bvh", "--finish", "--name", "mine", "--out", "new/own.npz"),
        *("--begin", "0.2", "--end", "0.8"),
    )
    assert code == 0
    motion = Motion.load(tmp_path / "new" / "own.npz")
    assert (motion.name, motion.robot, motion.rises) == ("mine", "op3", True)
    assert motion.provenance["clip"] == "clip.bvh"
