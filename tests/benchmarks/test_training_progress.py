"""The progress of a training: its speed, and when it had learned."""

from pathlib import Path

import pytest
from benchmark_scripts import load_script


@pytest.fixture
def progress(tmp_path: Path):
    """Read 60 iterations of 2 s and 100 steps; from the 30th on, all of the 10 falls stand."""
    rows = [f"{2.0 * (i + 1)},{100 * (i + 1)},10,{10 if i >= 30 else 0}" for i in range(60)]
    lines = "\n".join(["seconds,steps,falls,stood", *rows])
    (tmp_path / "progress.csv").write_text(lines + "\n", "utf-8")
    return load_script("training_progress").TrainingProgress.read(tmp_path)


def test_speed_is_counted_from_an_iteration_on_and_a_share_of_the_last_falls(progress):
    assert progress.steps_per_s(begin=1) == 50.0
    # 12 of the last 15 iterations are from the 30th on at the 42nd.
    assert progress.share[[29, 41, 44]] == pytest.approx([0.0, 0.8, 1.0])
