"""The tables of the confusion of styles, of robots that stand already."""

from pathlib import Path

import pytest

pytest.importorskip("onnx")

import style_confusion
from tiny_policies import save_styled_policy

from humanoid_getup.commands.learn.evaluate import EvaluateRequest, evaluate
from humanoid_getup.experiments.falls import CLASSES, Fall, FallSet
from robots import Robot
from robots.storage.encoding import to_json


def test_files_are_added_up(op3: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    policy, falls = str(save_styled_policy(tmp_path / "calm.onnx", op3)), tmp_path / "falls.npz"
    stands = tuple(Fall(posture=op3.standing, start_class=kind) for kind in CLASSES)
    FallSet(robot="op3", scene="flat", seed=5, falls=stands).save(falls)
    request = EvaluateRequest(policy=policy, n=4, falls=falls, style="sit-up,push-up")
    (tmp_path / "one.json").write_text(to_json(evaluate(request)))
    style_confusion.main((tmp_path / "one.json",) * 2)
    out = capsys.readouterr().out
    assert "| `sit-up` | 8 | 8 | 0 | 8 of 8 (68% to 100%) | 8 of 8 (68% to 100%) |" in out
    assert "| `all` | 16 |  |  | 16 of 16 (81% to 100%) | 16 of 16" in out
    assert "| `push-up` | 2, 2, 2 of 2 |" in out
