"""`getup first-steps --desk` in real time: one servo as shipped, from its port to validation."""

import json
from pathlib import Path

import pytest
from bus_stories import run_json
from first_connection import ALL_DONE, answer, begin, complete, find_port, serving
from terminal import in_terminal

SERVO = ("--servos", "XL430-W250:1")


@pytest.mark.realtime
def test_a_loose_servo_gets_from_its_port_to_its_validation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    link, out = tmp_path / "port", tmp_path / "out"
    at = ("--port", str(link))
    find_port(link, Path("/dev/null"), *SERVO)
    with serving(link, *SERVO) as bus:
        code, scanned = run_json("scan", *at, capsys=capsys)
        assert code == 0
        assert [device["id"] for scan in scanned["scans"] for device in scan["found"]] == [1]
        with in_terminal("first-steps", "--desk", *at, "--out", str(out)) as steps:
            begin(steps, "list")
            steps.see(": 1 servo at 57600 bit/s")
            answer(steps, "id", "7")
            steps.see("gets the id 7: write")
            steps.see("yes does it")
            steps.type("yes\n")
            steps.see(r"\(id 7\) replies at 57600 bit/s; was id 1")
            begin(steps, "monitor")
            bus.do("hold zero")
            bus.do("turn servo_1:30")
            steps.see(r"\+30\.0")
            steps.type("q")
            complete(steps, "wiggle")
            assert "1 followed" in steps.shown
            complete(steps, "validate", ALL_DONE)
            assert "1 passed" in steps.shown
            assert steps.wait() == 0
        code, read = run_json("servo", "read", "torque_enable", *at, capsys=capsys)
        assert (code, read["torque_enable"]["value"]) == (0, 0)
    done = json.loads((out / "first_steps.json").read_text())["steps"]
    assert [step["name"] for step in done] == ["list", "id", "monitor", "wiggle", "validate"]
    assert not any(step["skipped"] for step in done)
