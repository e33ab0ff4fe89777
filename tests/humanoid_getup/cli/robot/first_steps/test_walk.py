"""The walk through first steps: questions, repeats, what is kept, and where it goes on."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

from humanoid_getup.cli.robot.first_steps.finished_steps import FinishedSteps
from humanoid_getup.cli.robot.first_steps.step import FirstStep
from humanoid_getup.cli.robot.first_steps.walk import Walk
from humanoid_getup.jobs.errors import BadInputError

STEPS = (
    FirstStep(name="scan", aim="Look.", words=("scan",)),
    FirstStep(name="ids", aim="Set up.", words=("servo", "setup"), is_optional=True),
    FirstStep(name="rise", aim="Get up.", words=("rise",), at_bus="lay supine"),
)


class Person:
    """A person who answers, and the commands that run."""

    def __init__(self, *answers: str, codes: dict[str, list[int]] | None = None) -> None:
        self.answers, self.codes = list(answers), codes or {}
        self.ran: list[tuple[str, ...]] = []

    def tell(self, text: str) -> None:
        raise AssertionError(text)

    def ask(self, question: str) -> str:
        assert question
        return self.answers.pop(0)

    def run(self, words: Sequence[str]) -> int:
        self.ran.append(tuple(words))
        codes = self.codes.get(words[0])
        return codes.pop(0) if codes else 0


def walk(person: Person, folder: Path, first: str | None = None, **changes) -> int:
    given = {"steps": STEPS, "is_virtual": False} | changes
    return Walk(
        lambda: given["steps"],
        folder,
        FinishedSteps.load(folder, "op3"),
        prompt=person,
        console=Console(quiet=True),
        is_virtual=given["is_virtual"],
        run=person.run,
    ).go(first)


def kept(folder: Path) -> dict[str, bool]:
    steps = json.loads((folder / "first_steps.json").read_text())["steps"]
    return {step["name"]: step["skipped"] for step in steps}


def test_each_step_runs_after_enter_and_is_kept(tmp_path: Path):
    person = Person("", "", "")
    assert walk(person, tmp_path) == 0
    assert person.ran == [step.words for step in STEPS]
    assert kept(tmp_path) == {"scan": False, "ids": False, "rise": False}


def test_what_was_left_goes_on_where_it_ended(tmp_path: Path):
    assert walk(Person("", "q"), tmp_path) == 0
    assert kept(tmp_path) == {"scan": False}
    person = Person("s", "")
    assert walk(person, tmp_path) == 0
    assert person.ran == [("rise",)]
    assert kept(tmp_path) == {"scan": False, "ids": True, "rise": False}


def test_a_step_that_fails_is_repeated_or_left_with_its_code_and_never_skipped(tmp_path: Path):
    person = Person("s", "", "", "s", "q", codes={"scan": [3, 0], "servo": [2]})
    # "s" is no answer to scan; it fails, and works the second time; ids fails and is skipped.
    assert walk(person, tmp_path) == 0
    assert person.ran == [("scan",), ("scan",), ("servo", "setup")][:2]
    assert kept(tmp_path) == {"scan": False, "ids": True}
    left = Person("", "q", codes={"rise": [3]})
    assert walk(left, tmp_path) == 3
    assert "rise" not in kept(tmp_path)


def test_an_interrupted_step_ends_the_walk(tmp_path: Path):
    assert walk(Person("", codes={"scan": [130]}), tmp_path) == 130
    assert not (tmp_path / "first_steps.json").exists()


def test_a_chosen_step_comes_first_and_done_ones_may_be_skipped(tmp_path: Path):
    assert walk(Person("", "s", ""), tmp_path) == 0
    person = Person("s", "")
    assert walk(person, tmp_path, first="ids") == 0
    assert person.ran == [("rise",)]


def test_an_answer_becomes_the_last_word_of_a_command(tmp_path: Path):
    steps = (FirstStep(name="id", aim="Change.", words=("servo", "id"), asks="new id:"),)
    person = Person("7")
    assert walk(person, tmp_path, steps=steps) == 0
    assert person.ran == [("servo", "id", "7")]
    assert walk(Person(""), tmp_path, first="id", steps=steps) == 0
    assert kept(tmp_path) == {"id": True}


def test_steps_of_another_robot_or_a_damaged_file_are_refused(tmp_path: Path):
    FinishedSteps(robot="wolfgang", steps=()).save(tmp_path)
    with pytest.raises(BadInputError, match="keeps the steps of 'wolfgang', expected 'op3'"):
        walk(Person(), tmp_path)
    (tmp_path / "first_steps.json").write_text('{"robot": 3')
    with pytest.raises(BadInputError, match=r"first_steps\.json is damaged .*: remove it, or"):
        walk(Person(), tmp_path)
