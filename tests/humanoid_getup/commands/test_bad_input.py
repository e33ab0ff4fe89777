"""Bad input: one line that names the culprit, exit code 2, nothing written."""

from pathlib import Path

import pytest
from bad_inputs import GROUPS, Case, is_possible, make_files, run
from nonempty import nonempty

from robots import Robot

CASES = [case for cases in GROUPS.values() for case in cases]
LEARNING = "rsl_rl"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, op3: Robot) -> Path:
    """A folder of damaged and wrong files."""
    folder = tmp_path_factory.mktemp("bad_inputs")
    make_files(folder, op3)
    return folder


def list_files(folder: Path) -> dict[Path, tuple[int, int] | None]:
    """Return size and time of change of all files; folders have none."""
    found = {path: path.lstat() for path in folder.rglob("*")}
    return {
        path: None if path.is_dir() else (stat.st_size, stat.st_mtime_ns)
        for path, stat in found.items()
    }


def find_faults(case: Case) -> list[str]:
    """Run a case; list what its answer lacks."""
    code, out, error = run(case)
    answered = (code, out, error.startswith("getup: "), error.count("\n")) == (2, "", True, 1)
    if answered and all(part in error for part in case.message):
        return []
    return [f"getup {case.command}: exit code {code}, {out + error!r}, expected {case.message}"]


def check(cases: list[Case], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    before = list_files(folder)
    possible = nonempty(case for case in cases if is_possible(case))
    assert [fault for case in possible for fault in find_faults(case)] == []
    assert list_files(folder) == before


def test_the_table_is_as_long_as_promised():
    assert len({case.command for case in CASES}) == len(CASES) >= 110


@pytest.mark.parametrize("group", GROUPS)
def test_bad_input_is_refused_in_one_line(group: str, folder: Path, monkeypatch):
    check([case for case in GROUPS[group] if case.extra != LEARNING], folder, monkeypatch)


@pytest.mark.train
def test_bad_input_of_learning_is_refused_in_one_line(folder: Path, monkeypatch):
    check([case for case in CASES if case.extra == LEARNING], folder, monkeypatch)
