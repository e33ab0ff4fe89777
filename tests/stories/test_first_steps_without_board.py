"""`getup first-steps` in real time for a robot without a board, whose IMU is a chip on I2C."""

import json
import shutil
from pathlib import Path

import pytest
from first_connection import (
    STEP_TIME,
    begin,
    complete,
    find_port,
    rise,
    save,
    serving,
    skip,
    turn_each,
)
from paths import REPOSITORY
from terminal import in_terminal


@pytest.mark.realtime
def test_a_toddlerbot_gets_from_its_port_to_its_first_rise(tmp_path: Path):
    """At the 50 Hz of its makers' policies: two slow cores cannot serve and read 30 servos at 100.

    Its servos have little to spare: 60 % of their stall torque are too little for its rise.
    """
    robot = shutil.copytree(REPOSITORY / "robots" / "toddlerbot", tmp_path / "mine")
    description = robot / "robot.toml"
    text = description.read_text("utf-8")
    assert "control_period = 0.01 " in text
    description.write_text(
        text.replace("control_period = 0.01 ", "control_period = 0.02 "), "utf-8"
    )
    link, out = tmp_path / "port", tmp_path / "out"
    where = ("--robot", str(robot), "--port", f"main={link},imu={link}-imu", "--out", str(out))
    find_port(link, Path("/dev/null"), "--robot", str(robot), "--hold", "zero")
    with serving(link, "--robot", str(robot), "--hold", "zero") as bus:
        assert bus.read_line() == f"{link}-imu"
        with in_terminal("first-steps", *where) as steps:
            begin(steps, "scan")
            steps.see("30 devices")
            skip(steps, "ids")
            complete(steps, "doctor")
            assert f"IMU BNO08x on {link}-imu at 0x4A" in steps.shown
            begin(steps, "signs", lambda: bus.do("hang standing"))
            assert "type at getup bus: hang standing" in steps.shown, "its knees end at 0"
            turn_each(steps, bus, 30)
            save(steps)
            begin(steps, "zeros", lambda: bus.do("hold zero"))
            steps.see("hold it still")
            steps.type("\n")
            save(steps)
            begin(steps, "watch")
            steps.see(r"neck_yaw .*")
            steps.type("q")
            bus.do("hang standing")
            complete(steps, "wiggle")
            assert "30 followed" in steps.shown
            bus.do("hold standing")
            complete(steps, "squat")
            assert "followed: squat" in steps.shown
            begin(steps, "preflight")
            steps.see("does not end in a held stand", STEP_TIME)
            steps.see("preflight is not done: it ended with exit code 1")
            steps.see("q leaves:")
            steps.type("q\n")
            assert steps.wait() == 1
        with in_terminal("first-steps", *where, "--torque-limit", "1.42") as steps:
            complete(steps, "preflight")
            rise(steps, bus)
            assert steps.wait() == 0
    done = json.loads((out / "first_steps.json").read_text())["steps"]
    assert [step["name"] for step in done if step["skipped"]] == ["ids"]
    assert done[-1]["name"] == "rise"
    report = json.loads((out / "rise" / "report.json").read_text())
    assert report["stood"]
