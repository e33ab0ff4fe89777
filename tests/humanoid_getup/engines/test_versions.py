"""A worker with another program, other libraries or another robot is refused by name."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from counted_work import square

from humanoid_getup.engines.errors import VersionError
from humanoid_getup.engines.versions import CheckedWork, Versions, hash_folder
from robots import load_robot


def test_work_is_done_where_all_versions_are_the_same():
    assert CheckedWork(square, "op3", Versions.find("op3"))(7) == 49


@pytest.mark.parametrize("field", ["program", "libraries", "robot"])
def test_a_worker_that_differs_is_refused_by_what_differs(field: str):
    expected = replace(Versions.find("op3"), **{field: "another"})
    with pytest.raises(
        VersionError, match=rf"has another {field} \S.* \(expected another\)"
    ) as why:
        CheckedWork(square, "op3", expected)(7)
    assert str(why.value).isprintable()


def test_the_checksum_of_a_robot_is_that_of_its_content(tmp_path: Path):
    source = load_robot("op3").folder
    copy = shutil.copytree(source, tmp_path / "copy")
    assert hash_folder(copy) == hash_folder(source)
    (copy / "unfinished").mkdir(exist_ok=True)
    (copy / "unfinished" / "search.jsonl").write_text("{}")
    assert hash_folder(copy) == hash_folder(source)
    (copy / "robot.toml").write_text((copy / "robot.toml").read_text() + "\n")
    assert hash_folder(copy) != hash_folder(source)
