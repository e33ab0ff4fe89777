"""The script that compares mujoco-warp with MuJoCo, on a few falls."""

import json
from pathlib import Path

import pytest
from benchmark_scripts import load_script

pytest.importorskip("mujoco_warp", reason="needs the `warp` extra: make test-warp")

pytestmark = [pytest.mark.warp, pytest.mark.slow]


def test_falls_settle_alike(tmp_path: Path):
    parity, file = load_script("warp_parity"), tmp_path / "parity.json"
    parity.main(n=6, step=0.008, policy="", device="cpu", json=file)
    found = json.loads(file.read_text())
    settled, steps = found["settled"], found["steps"]
    assert steps["n"] == 6 * parity.STATES
    assert steps["differ"] < 0.1 * steps["n"]
    assert settled["warp"]["n"] == 6
    assert settled["warp"]["agree"] >= 5
    assert settled["rounded"]["agree"] == 6
    assert settled["speed_of_warp_over_mujoco"] > 0.0
