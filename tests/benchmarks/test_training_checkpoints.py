"""Checkpoints of a training are kept, and judged until the policy of one stands up."""

from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from benchmark_scripts import load_script

from sim2real.training.checkpoint import CHECKPOINT

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
