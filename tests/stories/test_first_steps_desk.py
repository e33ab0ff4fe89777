"""`getup first-steps --desk` in real time: a servo as shipped, from its port to its first move."""

import json
from pathlib import Path

import pytest
from bus_stories import run_json
from first_connection import ALL_DONE, answer, begin, complete, serving
from terminal import in_terminal

SERVO = ("--servos", "XL430-W250:1")


@pytest.mark.realtime
def test_a_loose_servo_gets_from_its_port_to_its_first_move(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
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
