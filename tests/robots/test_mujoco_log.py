"""MuJoCo warns on the terminal and leaves no file."""

from pathlib import Path

import mujoco
import pytest

UNSTABLE = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


def test_a_simulation_that_diverges_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    model = mujoco.MjModel.from_xml_string(UNSTABLE)
    data = mujoco.MjData(model)
    data.qvel[0] = 1e300
    mujoco.mj_step(model, data)
    assert data.warning.number.sum() == 1
    assert list(tmp_path.iterdir()) == []
