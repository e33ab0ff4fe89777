"""The page of your own robot, followed from a model file to a rise, word for word."""

import json
import shlex
from pathlib import Path

import pytest
from document_pages import list_commands
from model_files import write_model
from paths import REPOSITORY

from humanoid_getup.commands.main import main
from robots import load_robot

PAGE = REPOSITORY / "docs/how-to/your_robot.md"
MOTIONS = ["squat_to_stand", "supine_sit_up_fast"]
"""Of the many that the page retargets, those that a rise from the back needs."""


def find_line(start: str) -> list[str]:
    """Return the arguments of the only line of the page that starts so."""
    (line,) = (line for line in list_commands(PAGE) if line.startswith(f"getup {start}"))
    return shlex.split(line)[1:]


@pytest.mark.slow  # a minute
def test_a_model_file_becomes_a_robot_that_gets_up(tmp_path, op3, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path / "mine.xml", op3)
    assert main(find_line("robots import")) == 0
    assert load_robot("mine").n == op3.n
    assert main([*find_line("robots check")[:3], "--json", "check.json"]) == 0
    levels = [
        finding["level"] for finding in json.loads(Path("check.json").read_text())["findings"]
    ]
    assert levels.count("warning") == 1
    assert main([*find_line("motions retarget"), *MOTIONS]) == 0
    assert sorted(path.stem for path in Path("mine/motions").iterdir()) == MOTIONS
    assert main(find_line("rise")) == 0
    report = json.loads(Path("out/mine/report.json").read_text())
    assert (report["robot"], report["stood"]) == ("mine", True)


def test_the_page_has_every_step_from_import_to_benchmark():
    steps = [" ".join(line.split()[1:3]) for line in list_commands(PAGE)]
    order = ["robots import", "robots check", "motions retarget", "rise --robot", "bench rise"]
    assert [step for step in steps if step in order] == order
