"""Bad input: one line that names the culprit, exit code 2, nothing written."""

from pathlib import Path

import pytest
from bad_inputs import GROUPS, Case, is_possible, make_files, run

from robots import Robot

CASES = [case for cases in GROUPS.values() for case in cases]
PARAMETERS = [
    pytest.param(case, marks=pytest.mark.train if case.extra == "rsl_rl" else ()) for case in CASES
]


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


def test_the_table_is_as_long_as_promised():
    assert len({case.command for case in CASES}) == len(CASES) >= 110


@pytest.mark.parametrize("case", PARAMETERS, ids=lambda case: case.command[:60])
def test_bad_input_is_refused_in_one_line(case: Case, folder: Path, monkeypatch):
    if not is_possible(case):
        pytest.skip("root reads every file, or a package is missing")
    monkeypatch.chdir(folder)
    before = list_files(folder)
    code, out, error = run(case)
    assert (code, out) == (2, "")
    assert error.startswith("getup: ")
    assert error.count("\n") == 1
    for part in case.message:
        assert part in error
    assert list_files(folder) == before
