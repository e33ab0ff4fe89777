"""`getup mocap import`: a clip of a person becomes a motion of a robot."""

import json
from pathlib import Path

import numpy as np
import pytest
from human_clips import PERIOD, write_human_bvh
from run_getup import Run

from humanoid_getup.commands.errors import DID_NOT_STAND
from humanoid_getup.commands.motions.import_clip import ClipRequest, import_clip
from humanoid_getup.motions.motion import NO_END, Motion
from robots import load_robot


def test_a_clip_becomes_a_motion_and_its_deviation_is_reported(run: Run, tmp_path: Path):
    write_human_bvh(tmp_path / "sit up.bvh")
    wanted = ("mocap", "import", "sit up.bvh", "--robot", "human", "--json", "figures.json")
    code, out, error = run(*wanted)
    assert (code, error) == (0, "")
    assert "sit up.bvh: unit cm, y up, rest pose: angles zero, sides: as named" in out
    assert "sit_up: " in out
    assert "from supine" in out
    assert "next: getup play sit_up.npz --robot human" in out
    motion, human = Motion.load(tmp_path / "sit_up.npz"), load_robot("human")
    assert motion.robot == "human"
    assert np.diff(motion.time) == pytest.approx(human.control_period)
    assert motion.duration == pytest.approx(20 * PERIOD, rel=0.1)  # a body of about its size
    hip = human.joint_names.index("l_hip_pitch")
    assert np.degrees(motion.joint_pos[-1, hip]) == pytest.approx(-70.0, abs=2.0)
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["start_class"] == motion.start_class == "supine"
    assert figures["deviation_mean_deg"] < 2.0
    assert figures["slowdown"] == pytest.approx(1.0)
    assert figures["layout"] == {
        "unit_m": 0.01,
        "up": "y",
        "rest_pose": "angles zero",
        "sides": "as named",
    }


def test_with_finish_and_a_name_it_is_a_rise_that_is_written_where_asked(tmp_path: Path):
    clip, out = tmp_path / "clip.bvh", tmp_path / "new" / "own.npz"
    write_human_bvh(clip)
    part = {"begin": 0.2, "end": 0.8, "finish": True}
    import_clip(ClipRequest(files=(clip,), name="mine", out=out, **part))
    motion = Motion.load(out)
    assert (motion.name, motion.robot, motion.rises) == ("mine", "op3", True)
    assert motion.provenance["clip"] == "clip.bvh"


def test_a_clip_that_physics_brings_to_no_stand_is_told_with_how_near_it_came(
    run: Run, tmp_path: Path
):
    write_human_bvh(tmp_path / "clip.bvh")
    wanted = ("mocap", "import", "clip.bvh", "--physics", "--search-budget", "1")
    code, out, error = run(*wanted, "--json", "figures.json")
    assert (code, error) == (DID_NOT_STAND, "")
    assert "in physics it stands in 0 of 16 disturbed worlds" in out
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["stood_share"] == 0.0
    assert figures["end_class"] == Motion.load(tmp_path / "clip.npz").end_class == NO_END
    assert figures["limb_error_deg"] > 0.0 <= figures["overlap_mm"]
    assert "next: another --seed, or a longer --search-budget than 1 s" in out
    before = (tmp_path / "clip.npz").read_bytes()
    code, out, error = run(*wanted, "--seed", "2")
    assert (code, error) == (DID_NOT_STAND, "")
    assert "kept what is in clip.npz" in out
    assert (tmp_path / "clip.npz").read_bytes() == before
