"""`getup run` and `getup rise --method`: policies on the command line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

from tiny_policies import save_policy, weights_of

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.main import main
from robots import Robot
from robots.servo import RAD_PER_TICK

SHORT = ("--longest", "0.6")


@pytest.fixture
def policy(op3: Robot, tmp_path: Path) -> str:
    """A policy that thrashes about, the same way each time."""
    weight = np.random.default_rng(1).normal(size=weights_of(op3).shape, scale=3.0)
    return str(save_policy(tmp_path / "wild.onnx", op3, weight=weight, then=("Sin",)))


@pytest.fixture
def my_op3(op3: Robot, tmp_path: Path) -> Path:
    """A copy of the robot's folder with policies of its own."""
    mine = tmp_path / "mine"
    shutil.copytree(op3.folder, mine, ignore=shutil.ignore_patterns("policies"))
    (mine / "policies").mkdir()
    save_policy(mine / "policies" / "idle.onnx", op3)
    return mine


def run(*arguments: str, out: Path, code: int = 1) -> dict:
    assert main([*arguments, "--json", str(out)]) == code
    return json.loads(out.read_text())


@pytest.mark.usefixtures("no_film")
def test_a_policy_is_run_the_same_way_on_the_twin_and_on_the_bus(
    policy: str, op3: Robot, lying: str, tmp_path: Path
):
    start = ("run", policy, "--from", lying, *SHORT)
    reports = []
    for name, backend in (("twin", "twin"), ("bus", "virtual")):
        out = tmp_path / name
        assert main([*start, "--backend", backend, "--out", str(out)]) == 1
        reports.append(json.loads((out / "report.json").read_text()))
    on_twin, on_bus = reports
    for report in (on_twin, on_bus):
        assert (report["method"], report["policy"]) == ("policy", "wild")
        assert (report["stood"], report["attempts"], report["start_class"]) == (False, 1, "prone")
        assert report["clips"] == 0
    assert on_bus["peak_torque_nm"] == on_twin["peak_torque_nm"]
    records = [FlightRecord.load(tmp_path / name / "flight.mcap", op3) for name in ("twin", "bus")]
    paths = [record.state["joint_pos"] for record in records]
    assert len(paths[0]) == len(paths[1]) == 76  # 0.6 s and the cycle that ends it
    assert np.abs(paths[0] - paths[1]).max() < RAD_PER_TICK
    assert np.ptp(paths[0], axis=0).max() > 0.5
    assert (tmp_path / "twin" / "torque.png").exists()
    assert not (tmp_path / "twin" / "motion.npz").exists()


def test_a_rise_may_use_a_policy_by_name(my_op3: Path, lying: str, tmp_path: Path):
    arguments = ("rise", "--robot", str(my_op3), "--from", lying, "--attempts", "1")
    report = run(*arguments, "--method", "policy", "--policy", "idle", out=tmp_path / "rise.json")
    assert (report["method"], report["policy"], report["planned"]) == ("policy", "idle", False)
