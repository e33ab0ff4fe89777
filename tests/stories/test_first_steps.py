"""`getup first-steps` on the virtual bus in real time, from the port to the first rise."""

import json
import shutil
from pathlib import Path

import pytest
from first_connection import answer, begin, complete, leave, rise, save, serving, skip, turn_each
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
