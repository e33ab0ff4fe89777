"""What keeps the repository's tools, targets and tests as they should be."""

import re
import subprocess

import pytest
from paths import REPOSITORY
from sure_assertions import find_unsure_tests

MAKEFILE = (REPOSITORY / "Makefile").read_text("utf-8")


def test_pre_commit_runs_what_make_check_runs():
    recipe = re.search(r"^check:.*\n((?:\t.+\n)+)", MAKEFILE, re.MULTILINE)
    assert recipe
    commands = [line.strip().replace("$(BIN)", ".venv/bin") for line in recipe[1].splitlines()]
    hooks = (REPOSITORY / ".pre-commit-config.yaml").read_text("utf-8")
    assert len(commands) == 4
    assert re.findall(r"entry: (.+)", hooks) == commands


def test_make_help_has_a_line_for_every_target():
    text = subprocess.run(
        ["make", "--no-print-directory", "help"], cwd=REPOSITORY, capture_output=True, text=True
    ).stdout
    phony = re.search(r"^\.PHONY: (.+)$", MAKEFILE, re.MULTILINE)
    assert phony
    assert sorted(line.split()[0] for line in text.splitlines()) == sorted(phony[1].split())


def test_no_test_passes_because_its_loop_is_empty():
    """`nonempty` of tests/support is the remedy."""
    files = sorted((REPOSITORY / "tests").rglob("test_*.py"))
    assert len(files) > 200
    assert {file.name: unsure for file in files if (unsure := find_unsure_tests(file))} == {}


@pytest.mark.parametrize(
    ("body", "unsure"),
    [
        ("for item in items: assert item", True),
        ("for item in nonempty(items): assert item", False),
        ("for item in (1, 2): assert item", False),
        ("for item in (): assert item", True),
        ("for item in (1, 2):\n        for other in item: assert other", True),
        ("for item in items: assert item\n    assert items", False),
        ("assert all(item for item in items)", True),
        ("assert not any([item for item in items])", True),
        ("assert all(item for item in nonempty(items))", False),
        ("assert all(items)", False),
        ("while items: np.testing.assert_array_equal(items.pop(), 1)", True),
    ],
)
def test_an_assertion_in_a_loop_that_may_be_empty_is_found(body: str, unsure: bool, tmp_path):
    file = tmp_path / "test_items.py"
    file.write_text(f"def test_items(items):\n    {body}\n")
    assert find_unsure_tests(file) == ["test_items"] * unsure
