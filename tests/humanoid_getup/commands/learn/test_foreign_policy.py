"""`getup policy`: from the file of another project to a policy that is checked and runs."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
from foreign_policies import save_network
from paths import NODDING

from humanoid_getup.commands.main import main

STIFF = {"joint_stiffness": "15.0"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a policy of mjlab's."""
    monkeypatch.chdir(tmp_path)
    save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata(**STIFF))
    return tmp_path


def getup(line: str) -> int:
    return main(shlex.split(f"{line} --robot {NODDING}"))


def test_a_policy_is_imported_with_the_source_of_each_field(folder: Path, capsys):
    assert getup("policy import their.onnx --rate 62.5 --out ours --json import.json") == 0
    said = capsys.readouterr().out
    assert "default_pos: -0.2 to 0.3 rad (ONNX metadata default_joint_pos)" in said
    assert "rate: 62.5 Hz (--rate)" in said
    assert "note: action: ONNX metadata action_scale; mode assumed" in said
    result = json.loads((folder / "import.json").read_text())
    assert result == json.loads((folder / "ours" / "description.json").read_text())
    assert result["joints"] == dict(zip(made.JOINTS, ("r_hip", "head", "l_hip"), strict=True))


def test_a_policy_is_compared_with_a_trace_and_what_differs_ends_with_1(folder: Path, capsys):
    """A robot that lies still, whose network sees gravity alone."""
    assert getup("policy import their.onnx --rate 62.5 --out ours") == 0
    seen = np.zeros((20, 15))
    seen[:, 5], seen[:, 6:9] = -1.0, -np.array(made.DEFAULT)
    for row in range(1, 20):
        seen[row, 12:] = seen[row - 1] @ made.weights()
    still = {"gyro": 3, "joint_pos": 3, "joint_vel": 3}
    trace = {key: np.zeros((20, size)) for key, size in still.items()}
    trace |= {"joints": np.array(made.JOINTS), "time": np.arange(20) / 62.5}
    trace |= {"orientation": np.tile([1.0, 0, 0, 0], (20, 1)), "observation": seen}
    np.savez("right.npz", action=seen @ made.weights(), **trace)
    np.savez("wrong.npz", action=-seen @ made.weights(), **trace)
    capsys.readouterr()
    assert getup("policy check ours/policy.onnx --trace right.npz --json check.json") == 0
    assert capsys.readouterr().out.count("agrees") == 2
    assert json.loads((folder / "check.json").read_text())["steps"] == 20
    assert getup("policy check ours/policy.onnx --trace wrong.npz") == 1
    assert "differs: 'actions': 'r_hip' is -1 times as large in the" in capsys.readouterr().out


def test_an_imported_policy_runs_on_the_twin(folder: Path):
    assert getup("policy import their.onnx --rate 62.5 --out ours") == 0
    line = "run ours/policy.onnx --from supine --longest 0.5 --out run"
    assert getup(line) == 1  # it does not rise
    report = json.loads((folder / "run" / "report.json").read_text())
    assert report["policy"] == "policy"
