"""`getup first-steps` in real time: a robot to its first rise, a loose servo to its first move."""

import json
import shutil
from pathlib import Path

import pytest
from bus_stories import run_json
from first_connection import (
    ALL_DONE,
    answer,
    begin,
    complete,
    leave,
    rise,
    save,
    serving,
    skip,
    turn_each,
)
from paths import REPOSITORY
from terminal import in_terminal


@pytest.mark.realtime
def test_an_op3_gets_from_its_port_to_the_first_rise(tmp_path: Path):
    robot = shutil.copytree(REPOSITORY / "robots" / "op3", tmp_path / "mine")
    link, out = tmp_path / "port", tmp_path / "out"
    where = ("--robot", str(robot), "--port", str(link), "--out", str(out))
    with serving(link, "--robot", str(robot), "--hold", "zero") as bus:
        with in_terminal("first-steps", *where) as steps:
            begin(steps, "list")
            skip(steps, "ids")
            complete(steps, "doctor")
            begin(steps, "signs")
            turn_each(steps, bus, 20)
            save(steps)
            leave(steps, "zeros")
            assert steps.wait() == 0
        with in_terminal("first-steps", *where) as steps:  # goes on where it ended
            begin(steps, "zeros", lambda: bus.do("hold zero"))
            steps.see("hold it still")
            steps.type("\n")
            save(steps)
            begin(steps, "watch")
            steps.see(r"head_tilt .*")
            steps.type("q")
            bus.do("hang standing")
            answer(steps, "move", "l_knee")
            steps.see(r"joint 'l_knee' .* torque is off")
            complete(steps, "preflight")
            rise(steps, bus)
            assert steps.wait() == 0
    assert "calibration.virtual.toml" in {file.name for file in robot.iterdir()}
    kept = json.loads((out / "first_steps.json").read_text())
    assert [name for name, how in kept.items() if how == "skipped"] == ["ids"]
    report = json.loads((out / "rise" / "report.json").read_text())
    assert report["stood"]


SERVO = ("--servos", "XL430-W250:1")


@pytest.mark.realtime
def test_a_loose_servo_gets_from_its_port_to_its_first_move(tmp_path, capsys):
    link, out = tmp_path / "port", tmp_path / "out"
    at = ("--port", str(link))
    with serving(link, *SERVO) as bus:
        with in_terminal("first-steps", "--desk", *at, "--out", str(out)) as steps:
            begin(steps, "list")
            steps.see(": 1 device at ")
            answer(steps, "id", "7")
            steps.see("gets the id 7: write")
            steps.see("yes does it")
            steps.type("yes\n")
            steps.see(r"\(id 7\) replies at 57600 bit/s; was id 1")
            complete(steps, "read")
            assert "present_input_voltage" in steps.shown
            begin(steps, "monitor")
            bus.do("hold zero")
            bus.do("turn servo_1:30")
            steps.see(r"\+30\.0")
            steps.type("q")
            complete(steps, "move", ALL_DONE)
            assert "torque is off" in steps.shown
            assert steps.wait() == 0
        code, read = run_json("servo", "read", "torque_enable", *at, capsys=capsys)
        assert (code, read["torque_enable"]["value"]) == (0, 0)
    kept = json.loads((out / "first_steps.json").read_text())
    assert kept == dict.fromkeys(("list", "id", "read", "monitor", "move"), "done")
