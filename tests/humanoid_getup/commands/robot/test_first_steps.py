"""`getup first-steps`: every step is a command, runs after Enter, and is kept when it is done."""

import json
import shlex
import sys
from pathlib import Path

import pytest
from nonempty import nonempty

from humanoid_getup.commands.command_line import parse
from humanoid_getup.commands.main import main
from humanoid_getup.commands.robot import first_steps
from robots import Robot, load_robot

PORT = ("/dev/ttyUSB0",)


def list_steps(name: str, **changes) -> dict[str, first_steps.Task]:
    command = first_steps.FirstSteps(robot=name, port=PORT, **changes)
    robot = None if command.desk else load_robot(name)
    return {step.name: step for step in first_steps.list_steps(command, robot, Path("out"))}


def test_every_step_is_a_command():
    for steps in (list_steps("op3", desk=True), list_steps("op3"), list_steps("toddlerbot")):
        for step in nonempty(list(steps.values())):
            last = {"": "", "new id": "7", "joint": "l_knee"}[step.asks]
            assert parse(shlex.split(f"{step.command} {last}")).options.find_problems() == []
            assert "{" not in " ".join(step)


def test_torque_comes_after_what_is_without_it_and_grows(op3):
    steps = list_steps("op3")
    words = [step.command.split() for step in steps.values()]
    torques = [float(w[w.index("--torque-limit") + 1]) for w in words if "--torque-limit" in w]
    assert torques == sorted(torques)
    assert torques[0] < 0.35 * op3.max_torque.max()
    assert torques[-1] < 0.65 * op3.max_torque.max()
    order = list(steps)
    assert order.index("doctor") < order.index("watch") < order.index("move")
    assert order.index("preflight") < order.index("rise")
    assert "--torque-limit 1.425" in list_steps("op3", torque_limit=1.425)["rise"].command


def test_a_robot_that_cannot_lie_down_goes_limp_in_the_hands_of_a_person(monkeypatch):
    assert "--then hold" in list_steps("op3")["rise"].command
    rise = list_steps("toddlerbot")["rise"]
    assert "--then limp" in rise.command
    assert "hold it" in rise.aim
    monkeypatch.setattr(Robot, "imu_kind", None)
    rise = list_steps("op3")["rise"]
    assert parse(shlex.split(rise.command)).options.without_imu, "it plays a motion"
    assert "--then limp" in rise.command


def test_no_step_says_that_torque_is_off():
    """A command before may have left it on: that is read from the servo, never told."""
    for step in (*nonempty(list(first_steps.DESK)), *nonempty(list(first_steps.ROBOT))):
        assert "torque is off" not in step.aim + step.before.replace("where its torque is off", "")


class Person:
    """A person who answers, and the commands that run."""

    def __init__(self, *answers: str, codes: dict[str, list[int]] | None = None) -> None:
        self.answers, self.codes = list(answers), codes or {}
        self.ran: list[str] = []

    def isatty(self) -> bool:
        return True

    def readline(self) -> str:
        return f"{self.answers.pop(0)}\n" if self.answers else ""

    def run(self, *words: str) -> int:
        self.ran.append(" ".join(words[:2]))
        codes = self.codes.get(words[1])
        return codes.pop(0) if codes else 0


@pytest.fixture
def walk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def go(person: Person) -> tuple[int, dict[str, str]]:
        monkeypatch.setattr(sys, "stdin", person)
        monkeypatch.setattr(first_steps, "run_getup", person.run)
        code = main(("first-steps", "--desk", "--port", "/dev/null", "--out", str(tmp_path)))
        file = tmp_path / "first_steps.json"
        return code, json.loads(file.read_text()) if file.exists() else {}

    return go


def test_each_step_runs_after_its_answer_and_what_was_left_goes_on_where_it_ended(walk):
    person = Person("", "7", "q")
    code, kept = walk(person)
    assert (code, kept) == (0, {"list": "done", "id": "done"})
    assert person.ran == ["servo list", "servo id"]
    person = Person("s", "no", "", "")  # which is no answer to a step that asks for nothing
    code, kept = walk(person)
    assert code == 0
    assert person.ran == ["servo monitor", "servo move"]
    assert list(kept) == [step.name for step in first_steps.DESK]
    assert kept["read"] == "skipped"


def test_a_step_that_fails_is_repeated_or_left_with_its_code(walk, capsys):
    person = Person("", "", "s", "", "q", codes={"list": [3, 0], "read": [2]})
    code, kept = walk(person)
    assert person.ran == ["servo list", "servo list", "servo read"]
    assert (code, kept) == (2, {"list": "done", "id": "skipped"})
    assert "list is not done: exit code 3, see above" in capsys.readouterr().out


def test_an_interrupted_step_ends_the_walk(walk):
    assert walk(Person("", codes={"list": [130]})) == (130, {})


def test_without_a_person_or_with_a_damaged_file_nothing_begins(tmp_path, capsys, monkeypatch):
    (tmp_path / "first_steps.json").write_text('{"list": ')
    monkeypatch.setattr(sys, "stdin", Person())
    assert main(("first-steps", "--desk", "--port", "/dev/null", "--out", str(tmp_path))) == 2
    assert "first_steps.json is damaged" in capsys.readouterr().err
    monkeypatch.setattr(sys, "stdin", None)
    assert main(("first-steps", "--port", "/dev/null")) == 2
    assert "standard input is not a terminal: first-steps needs a person" in capsys.readouterr().err
