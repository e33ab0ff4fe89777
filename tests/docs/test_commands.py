"""Every `getup` line of README and documentation is one that the program understands."""

import re
import shlex

from document_pages import PAGES, list_commands, name_of
from nonempty import nonempty
from paths import REPOSITORY

from humanoid_getup.commands.command_line import parse
from humanoid_getup.commands.command_table import COMMANDS
from humanoid_getup.motions.motion_database import load_database

LINES = sorted({(line, name_of(page)) for page in PAGES for line in list_commands(page)})


def test_the_commands_of_the_documentation_are_understood(op3, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    motions = [known.name for known in load_database(op3).motions]
    for line, page in nonempty(LINES):
        for folder in re.findall(r"--(?:parent|prior|folder|write) (\S+)", line):
            (tmp_path / folder).mkdir(parents=True, exist_ok=True)
            (tmp_path / folder / "robot.toml").touch()
        options = parse(shlex.split(line, comments=True)[1:]).options
        assert options.find_problems() == [], (line, page)
        motion = getattr(options, "motion", None)
        assert not motion or motion.endswith(".npz") or motion in motions, (line, page)


def test_every_command_of_the_program_is_in_the_reference():
    reference = (REPOSITORY / "docs/reference/command_line.md").read_text("utf-8")
    assert len(COMMANDS) >= 40
    assert [name for name in COMMANDS if f"## getup {name}\n" not in reference] == []
