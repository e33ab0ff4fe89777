"""The steps of robots and loose servos: every one is a command that the program understands."""

from dataclasses import replace
from pathlib import Path

import pytest
from nonempty import nonempty

from humanoid_getup.cli.commands import parse
from humanoid_getup.cli.main import main
from humanoid_getup.cli.robot.first_steps.desk_steps import list_desk_steps
from humanoid_getup.cli.robot.first_steps.first_steps import read_voltage
from humanoid_getup.cli.robot.first_steps.robot_steps import RobotAtPort, list_robot_steps
from humanoid_getup.cli.robot.first_steps.step import FirstStep
from robots import load_robot


def list_steps(name: str, **changes) -> dict[str, FirstStep]:
    known = RobotAtPort(
        robot=load_robot(name), chosen=name, port=("/dev/ttyUSB0",), out=Path("out")
    )
    return {step.name: step for step in list_robot_steps(replace(known, **changes))}


@pytest.mark.parametrize("name", ["op3", "toddlerbot", "wolfgang"])
def test_every_step_of_a_robot_is_a_command(name: str):
    steps = list_steps(name)
    assert list(steps)[:3] == ["scan", "ids", "doctor"]
    assert list(steps)[-1] in ("rise", "motions")
    for step in nonempty(list(steps.values())):
        assert parse(step.words).options.find_problems() == []


def test_every_step_of_loose_servos_is_a_command():
    steps = list(list_desk_steps("/dev/ttyUSB0"))
    for step in nonempty(steps):
        words = (*step.words, "7") if step.asks else step.words
        assert parse(words).options.find_problems() == []


@pytest.mark.parametrize(("name", "posture"), [("op3", "zero"), ("toddlerbot", "standing")])
def test_joints_turn_and_swing_where_they_have_room(name: str, posture: str):
    """The knee of a ToddlerBot is at its end where its angle is 0."""
    steps = list_steps(name)
    assert steps["signs"].at_bus.startswith(f"hang {posture}, ")
    assert steps["wiggle"].at_bus == f"hang {posture}"


def test_torque_comes_after_what_is_without_it_and_grows(op3):
    steps = list_steps("op3")
    torques = [
        float(step.words[step.words.index("--torque-limit") + 1])
        for step in steps.values()
        if "--torque-limit" in step.words
    ]
    assert torques == sorted(torques)
    assert torques[0] < 0.35 * op3.max_torque.max()
    assert torques[-1] < 0.65 * op3.max_torque.max()
    order = list(steps)
    assert order.index("doctor") < order.index("watch") < order.index("wiggle")
    assert order.index("preflight") < order.index("rise")


def test_a_robot_without_a_motion_to_lie_down_goes_limp_in_the_hands_of_a_person():
    rise = list_steps("toddlerbot")["rise"]
    assert ("--then", "limp") in zip(rise.words, rise.words[1:], strict=False)
    assert "Hold it once it stands" in rise.before
    assert "--then" not in list_steps("op3")["rise"].words


def test_a_torque_limit_that_is_given_is_not_rounded():
    words = list_steps("op3", torque_limit=1.425)["preflight"].words
    assert words[words.index("--torque-limit") + 1] == "1.425"


def test_the_supply_that_the_doctor_measured_is_that_of_the_preflight(tmp_path: Path):
    file = tmp_path / "doctor.json"
    assert read_voltage(file) is None
    file.write_text('{"joints": {"a": {"voltage_v": 11.5}, "b": {"voltage_v": 11.7}}}')
    assert read_voltage(file) == pytest.approx(11.6)
    assert "11.6" in list_steps("op3", voltage=read_voltage(file))["preflight"].words
    file.write_text("[]")
    assert read_voltage(file) is None


def test_without_a_person_nothing_begins(capsys: pytest.CaptureFixture[str], monkeypatch):
    monkeypatch.setattr("sys.stdin", None)
    assert main(("first-steps", "--port", "/dev/null")) == 2
    assert "standard input is not a terminal: first-steps needs a person" in capsys.readouterr().err
