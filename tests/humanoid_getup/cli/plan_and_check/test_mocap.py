"""`getup mocap import`: a clip that the test writes becomes a motion of a robot."""

import json

import numpy as np
import pytest
from human_clips import PERIOD, write_human_bvh
from run_getup import Run

from humanoid_getup.motions.motion import Motion
from robots import load_robot


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
