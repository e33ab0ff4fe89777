"""What keeps the repository's tools, targets and tests as they should be."""

import re
import subprocess

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
