"""The counts of `benchmarks/code_size.py`, on a checkout of three files."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest
from paths import REPOSITORY

OUTER = '''"""Calls what is in the other file, and comes back."""

class Body: pass

def walk():
    """Visit."""
    one()
    _own()
    two()

def _own():
    return [_ for _ in ()]
'''
INNER = "def one():\n    two()\n\ndef two():\n    '''Do nothing.'''\n"


@pytest.fixture
def script() -> dict[str, Any]:
    return runpy.run_path(str(REPOSITORY / "benchmarks" / "code_size.py"))


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name in ("robots/deep", "drivers", "humanoid_getup", "sim2real", "tests"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "drivers/outer.py").write_text(OUTER)
    (tmp_path / "robots/inner.py").write_text(INNER)
    (tmp_path / "robots/deep/__init__.py").write_text("")
    return tmp_path


def test_a_checkout_is_counted(script: dict[str, Any], tree: Path):
    counts = script["count"](tree)
    assert (counts["files"], counts["lines"], counts["lines_not_blank"]) == (3, 17, 13)
    assert counts["depth"] == 2
    assert counts["function_lines"] == {"median": 2, "p90": pytest.approx(4.1), "max": 5}
    assert (counts["public_names"], counts["public_names_documented"]) == (4, 2)


def test_a_walk_counts_each_function_once_where_it_is_first_called(
    script: dict[str, Any], tree: Path
):
    names: dict[str, Any] = {}
    with script["traced"](tree) as walk:
        for file in (tree / "robots/inner.py", tree / "drivers/outer.py"):
            exec(compile(file.read_text(), str(file), "exec"), names)  # the script reads file names
        names["walk"]()
    # walk -> one, two (in the other file) -> _own (back); two is known by then. What runs when
    # the files are read, the bodies of their classes, is no function.
    assert walk.pop("most_returns") == {"drivers/outer.py": 1}
    assert walk == {"functions": 4, "stops": 3, "files": 2, "returns": 1, "folders": 2}
