"""A log is exported with an extra; without it, one line says what to install."""

import sys
from pathlib import Path

import pytest
from paths import TINY

from humanoid_getup.cli.main import main


def test_without_the_extra_one_line_names_the_command_that_installs_it(
    swing: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.delitem(sys.modules, "humanoid_getup.ros.rosbag", raising=False)
    monkeypatch.setitem(sys.modules, "mcap_ros2", None)
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    words = ["log", "export", str(swing), "--robot", str(TINY), "--rosbag2", str(tmp_path / "bag")]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'humanoid-getup[ros]'" in line
    assert list(tmp_path.iterdir()) == []
