"""Every `getup` line of README and documentation is one that the program understands."""

import json
import shlex
from pathlib import Path

import pytest
from document_pages import PAGES, list_commands, name_of
from paths import REPOSITORY

from humanoid_getup.commands.command_line import parse
from humanoid_getup.commands.command_table import COMMANDS
from humanoid_getup.commands.main import main
from humanoid_getup.motions.motion_database import load_database
from robots import Robot

LINES = sorted({(line, name_of(page)) for page in PAGES for line in list_commands(page)})


@pytest.mark.parametrize(("line", "page"), LINES)
def test_a_command_of_the_documentation_is_understood(line: str, page: str, op3: Robot):
    options = parse(shlex.split(line, comments=True)[1:]).options
    assert options.find_problems() == [], page
    motion = getattr(options, "motion", None)
    if motion and not motion.endswith(".npz"):
        assert motion in [known.name for known in load_database(op3).motions], page


@pytest.mark.parametrize(
    ("page", "names"),
    [
        ("README.md", ("rise", "play", "run")),
        (
            "docs/tutorial/first_connection.md",
            ("servo", "doctor", "calibrate", "rise"),
        ),
        ("docs/how-to/train.md", ("train", "export", "eval")),
        ("docs/how-to/virtual_bus.md", ("bus", "servo", "doctor", "rise")),
    ],
)
def test_the_commands_of_a_page_are_found(page: str, names: tuple[str, ...]):
    lines = list_commands(REPOSITORY / page)
    assert set(names) <= {line.split()[1] for line in lines}


def test_every_command_of_the_program_is_in_the_reference():
    reference = (REPOSITORY / "docs/reference/command_line.md").read_text("utf-8")
    assert len(COMMANDS) >= 40
    assert [name for name in COMMANDS if f"## getup {name}\n" not in reference] == []


@pytest.mark.parametrize(
    "line",
    [
        "getup robots --json robots.json",
        "getup motions list --json motions.json",
        "getup preflight supine_long_sit --voltage 11.6 --torque-limit 2.5 --json preflight.json",
        "getup play prone_push_up_gentle --out out/play --json play.json",
    ],
)
def test_a_cheap_command_of_the_documentation_does_what_it_says(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    documented = {found.split(" --json")[0] for found, _ in LINES} | {
        "getup robots",  # has no options to be recognized by
        "getup motions list",
    }
    assert line.split(" --json")[0] in documented
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(line)[1:]) == 0
    (written,) = tmp_path.glob("*.json")
    assert json.loads(written.read_text())
