"""The guide to a first connection: every command in it is one that the program understands."""

import re
import shlex

import pytest
from paths import REPOSITORY

from humanoid_getup.cli.commands import parse
from humanoid_getup.motions.motion_database import load_database
from robots import load_robot

GUIDE = REPOSITORY / "docs" / "first_connection.md"


def list_commands() -> list[str]:
    text = GUIDE.read_text("utf-8")
    blocks = re.findall(r"^(getup .+)$", text, re.MULTILINE)
    return blocks + re.findall(r"`(getup \w+ --?[^`]+|getup play [^`]+|getup replay [^`]+)`", text)


@pytest.mark.parametrize("line", list_commands())
def test_a_command_of_the_guide_is_understood(line: str):
    command = parse(shlex.split(line)[1:])
    find_faults = getattr(command, "find_faults", list)
    assert find_faults() == []
    if hasattr(command, "motion"):
        names = [motion.name for motion in load_database(load_robot("op3")).motions]
        assert command.motion in names


def test_the_guide_has_commands_to_check():
    told = " ".join(list_commands())
    assert all(f"getup {name} " in told for name in ("doctor", "calibrate", "rise", "bus", "play"))
