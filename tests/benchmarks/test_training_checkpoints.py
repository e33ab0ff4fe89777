"""Checkpoints of a training are kept, and judged until the policy of one stands up."""

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from benchmark_scripts import load_script
from distributed_training import TINY

from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.train import TrainingInputs, train

pytestmark = pytest.mark.train


@pytest.fixture
def script():
    return load_script("training_checkpoints")


def test_every_checkpoint_is_kept_once_as_it_was(script, tmp_path: Path):
    training = tmp_path / "training"
    training.mkdir()
    (training / "recipe.json").write_text("{}")
    kept = script.KeptCheckpoints(training=training, folder=tmp_path / "kept")
    kept.look()
    assert kept.found == []
    for text in ("first", "second"):
        (training / "new").write_text(text)
        (training / "new").replace(training / CHECKPOINT)
        kept.look()
        kept.look()
    assert [(each / CHECKPOINT).read_text() for each in kept.found] == ["first", "second"]
    assert all((each / "recipe.json").exists() for each in kept.found)


def test_they_are_judged_until_a_policy_stands_up(script, op3, tmp_path: Path, monkeypatch):
    training = tmp_path / "training"
    kept = script.KeptCheckpoints(training=training, folder=tmp_path / "kept")
    with kept.keeping():
        train(op3, replace(TINY, iterations=2), 1, training, TrainingInputs(threads=1))
    iterations = [int(read_checkpoint(each / CHECKPOINT)["iter"]) for each in kept.found]
    assert iterations[-1] == 1
    progress = load_script("training_progress").TrainingProgress.read(training)
    monkeypatch.setattr(script, "FALLS", 4)
    falls = tmp_path / "falls.npz"
    (judged,) = script.judge_until(kept.found, progress, 0.0, falls)
    assert judged.minutes == progress.seconds[iterations[0]] / 60.0
    assert judged.steps == progress.steps[iterations[0]]
    assert 0.0 <= judged.stood <= 1.0
    assert script.judge_until(kept.found, progress, 1.1, falls) == [], "nor is it tried"
