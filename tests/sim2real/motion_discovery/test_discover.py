"""`getup motions discover`: a robot without motions gets those that its policy knows."""

import shutil
from pathlib import Path

import pytest

from humanoid_getup.cli.main import main
from humanoid_getup.motions.motion import Motion
from robots import Robot


@pytest.fixture
def bare(op3: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of OP3 with its policies and without motions."""
    shutil.copytree(op3.folder, tmp_path / "bare", ignore=shutil.ignore_patterns("motions"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "bare"


@pytest.mark.slow
def test_motions_are_discovered_from_every_side_and_can_be_played(
    bare: Path, capsys: pytest.CaptureFixture[str]
):
    options = ("--robot", "bare", "--rises", "12", "--most", "1")
    assert main(["motions", "discover", "quick", *options]) == 0
    out = capsys.readouterr().out
    files = sorted((bare / "motions").iterdir())
    assert [file.stem for file in files] == ["left_quick_1", "prone_quick_1", "supine_quick_1"]
    for motion in map(Motion.load, files):
        assert motion.provenance["disturbed_success"] >= 0.8
        assert motion.provenance["policy"] == "quick"
        assert f"motion '{motion.name}' ({motion.strategy}) stands" in out
    assert main(["play", "prone_quick_1", "--robot", "bare", "--out", "played"]) == 0
    assert main(["motions", "discover", "quick", *options]) == 2
    assert "are there already: left_quick_1, prone_quick_1" in capsys.readouterr().err


def test_a_policy_with_style_curves_is_refused(bare: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["motions", "discover", "styled", "--robot", "bare"]) == 2
    assert "follows style curves, expected one without" in capsys.readouterr().err
    assert not (bare / "motions").exists()
