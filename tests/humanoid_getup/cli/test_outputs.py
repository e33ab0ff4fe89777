"""Files appear whole and together, or not at all."""

from pathlib import Path

import pytest

from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.output import find_folder_faults, staging, write_json

NAMES = ("report.json", "strip.png")


def test_files_appear_together_in_a_folder_that_is_made_for_them(tmp_path: Path):
    folder = tmp_path / "new" / "out"
    with staging(folder, NAMES) as scratch:
        for name in NAMES:
            (scratch / name).write_text(name)
        assert not folder.exists()
    assert sorted(path.name for path in folder.iterdir()) == sorted(NAMES)
    assert list(tmp_path.iterdir()) == [tmp_path / "new"]


def test_nothing_appears_when_the_work_breaks_off(tmp_path: Path):
    with pytest.raises(KeyboardInterrupt), staging(tmp_path / "out", NAMES) as scratch:
        (scratch / "report.json").write_text("half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_runs_files_go_and_the_users_own_stay(tmp_path: Path):
    for name in (*NAMES, "notes.txt"):
        (tmp_path / name).write_text("old")
    with staging(tmp_path, NAMES) as scratch:
        (scratch / "report.json").write_text("new")
    left = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert left == {"report.json": "new", "notes.txt": "old"}


def test_what_gets_in_the_way_during_the_work_is_told(tmp_path: Path):
    folder = tmp_path / "out"
    told = pytest.raises(BadInputError, match=r"output folder .*out: File exists")
    with told, staging(folder, NAMES) as scratch:
        (scratch / "report.json").write_text("new")
        folder.write_text("meanwhile")
    assert folder.read_text() == "meanwhile"


def test_trying_a_folder_leaves_nothing_behind(tmp_path: Path):
    assert find_folder_faults(tmp_path / "some" / "where", NAMES) == []
    assert list(tmp_path.iterdir()) == []


def test_json_goes_to_standard_output_alone(capsys: pytest.CaptureFixture[str]):
    write_json("{}\n", "-")
    assert capsys.readouterr() == ("{}\n", "")
