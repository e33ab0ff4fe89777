import os
import re
from pathlib import Path

import pytest

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.studio.folders import MOST_FILES, Folders, containing


def test_names_are_relative_to_the_first_folder(tmp_path: Path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    (first / "a.json").touch()
    (second / "b.json").touch()
    (second / "c.txt").touch()
    folders = Folders([first, second])
    assert folders.resolve("a.json") == first / "a.json"
    assert folders.resolve(f"{second}/new.json") == second / "new.json"
    assert sorted(folders.list_files(".json")) == [str(second / "b.json"), "a.json"]
    assert [folders.resolve(name).is_file() for name in folders.list_files(".json")] == [True] * 2


def test_many_other_files_hide_none_that_is_accepted(tmp_path: Path):
    (tmp_path / "wanted.toml").write_text("[key]")
    os.utime(tmp_path / "wanted.toml", (0, 0))
    for number in range(MOST_FILES + 10):
        (tmp_path / f"{number}.toml").touch()
    folders = Folders([tmp_path])
    assert "wanted.toml" not in folders.list_files(".toml")
    assert folders.list_files(".toml", containing(re.compile(rb"^\[key"))) == ["wanted.toml"]


def test_files_outside_are_refused_and_links_to_them_not_listed(tmp_path: Path):
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "out").symlink_to(tmp_path)
    for name in ("../x.json", "a/../../x.json", "/etc/passwd", "out/x", "nul\0"):
        with pytest.raises(BadInputError, match=r"file "):
            Folders([inside]).resolve(name)
    (tmp_path / "secret.json").touch()
    (inside / "link.json").symlink_to(tmp_path / "secret.json")
    assert Folders([inside]).list_files(".json") == []
