"""`getup policy`: from the file of another project to a policy that is checked and packed."""

import json
import shlex
from pathlib import Path

import msgspec
import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
from foreign_policies import save_network
from paths import NODDING

from humanoid_getup.cli.main import main
from humanoid_getup.policy.pack import Manifest

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


def pack(folder: Path) -> Path:
    """Import and pack a policy with an evaluation."""
    (folder / "eval.json").write_text(
        json.dumps({"name": "eval", "cases": {"flat": {"all": {"n": 8, "stood": 3}}}})
    )
    assert getup("policy import their.onnx --rate 62.5 --out ours") == 0
    line = "policy pack ours/policy.onnx --name swing --entry supine --evaluation eval.json"
    assert getup(f"{line} --out packed") == 0
    return folder / "packed"


def test_a_packed_policy_tells_what_it_is_and_comes_back_the_same(folder: Path):
    packed = pack(folder)
    manifest = json.loads((packed / "manifest.json").read_text())
    assert (manifest["name"], manifest["kind"], manifest["entry_pose"]) == (
        "swing",
        "episodic",
        "supine",
    )
    assert manifest["robot"]["model"] == "nodding" and manifest["action_len"] == 3
    assert manifest["training"] == {"imported_from": "mjlab", "network": "their.onnx"}
    assert manifest["eval"] == {"flat": {"n": 8, "stood": 3}}
    assert [each["file"] for each in manifest["files"]] == ["policy.onnx", "eval.json"]
    assert getup("policy import packed --out back") == 0
    assert (folder / "back/policy.onnx").read_bytes() == (packed / "policy.onnx").read_bytes()


@pytest.mark.parametrize("name", ["policy.onnx", "eval.json", "manifest.json"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_changed_byte_of_a_packed_policy_is_one_line(
    folder: Path, capsys, name: str, share: float
):
    file = pack(folder) / name
    content = bytearray(file.read_bytes())
    place = int(share * len(content))
    content[place] ^= 1
    file.write_bytes(content)
    capsys.readouterr()
    assert getup("policy import packed --out back") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and name in error
    assert not (folder / "back").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"obs_len": 3, "training": {}}, "obs_len, training: not as in the contract"),
        ({"name": "\x1b[2Jswing"}, "name or description cannot be printed"),
        ({"licence": "any"}, "malformed: Object contains unknown field `licence`"),
    ],
)
def test_a_manifest_that_is_not_of_its_policy_is_refused(folder: Path, capsys, changes, message):
    file = pack(folder) / "manifest.json"
    record = json.loads(file.read_text()) | changes
    known = {name: record[name] for name in Manifest.__struct_fields__}
    record["sha256"] = msgspec.convert(known, Manifest).sealed().sha256
    file.write_text(json.dumps(record))
    capsys.readouterr()
    assert getup("policy import packed --out back") == 2
    assert message in capsys.readouterr().err
    assert not (folder / "back").exists()


def test_a_policy_with_a_contract_of_ours_is_not_imported_twice(folder: Path, capsys):
    pack(folder)
    assert getup("policy import ours/policy.onnx --out again") == 2
    assert "it has a policy contract of ours: `getup run`" in capsys.readouterr().err
