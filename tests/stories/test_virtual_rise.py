"""`getup rise --backend virtual`: through the real driver, over a serial port, to a stand."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import HARDWARE_FAULT
from humanoid_getup.commands.main import main
from robots import Robot
from robots.servo import RAD_PER_TICK

START = 60.0  # s that a program may take until it serves or has played


def rise(*arguments: str, out: Path) -> dict:
    figures = out / "figures.json"
    out.mkdir()
    assert main(["rise", *arguments, "--json", str(figures), "--out", str(out)]) == 0
    return json.loads(figures.read_text())


@pytest.mark.slow  # half a minute
@pytest.mark.parametrize("start", ["supine", "prone", "left", "right"])
def test_a_fallen_robot_gets_up_over_the_bus_from_every_side(start: str, tmp_path: Path):
    report = rise("--from", start, "--backend", "virtual", out=tmp_path / "out")
    assert (report["stood"], report["backend"]) == (True, "virtual")
    assert (report["judged_by"], report["attempts"]) == ("truth", 1)
    assert (
        report["stand_time_s"] < 10.0
    )  # a fall with crossed limbs takes a try more, within one plan


@pytest.mark.usefixtures("no_film")
def test_one_seed_is_one_rise_on_the_twin_and_on_the_bus(op3: Robot, tmp_path: Path):
    same = ("--from", "supine", "--seed", "2", "--then", "limp")
    on_twin = rise(*same, out=tmp_path / "twin")
    on_bus = rise(*same, "--backend", "virtual", out=tmp_path / "bus")
    for key in ("stood", "stand_time_s", "peak_torque_nm", "connection", "rollouts"):
        assert on_bus[key] == on_twin[key], key
    assert (on_bus["stood"], on_bus["backend"], on_bus["judged_by"]) == (True, "virtual", "truth")
    records = [FlightRecord.load(tmp_path / name / "flight.mcap", op3) for name in ("twin", "bus")]
    paths = [record.state["joint_pos"] for record in records]
    assert len(paths[0]) == len(paths[1]) > 500
    assert np.abs(paths[0] - paths[1]).max() < RAD_PER_TICK


@pytest.mark.realtime
def test_a_robot_behind_a_port_is_judged_by_its_sensors_and_left_limp(tmp_path: Path):
    """A bus in a process of its own, in real time; the client knows only its port.

    A machine that is busy with other work cannot keep real time: the guard then stops the rise,
    as it should. So there are three tries, each on a bus of its own.
    """
    for trial in range(3):
        code, report = rise_behind_a_port(tmp_path / str(trial))
        if code != HARDWARE_FAULT:
            break
    assert report["judged_by"] == "sensors"
    assert (code, report["stood"]) == (0, True), report["reason"]
    assert report["start_class"] == "supine"


def rise_behind_a_port(folder: Path) -> tuple[int, dict]:
    folder.mkdir()
    link = folder / "port"
    command = [sys.executable, "-m", "humanoid_getup.commands.main", "bus", "--from", "supine"]
    with subprocess.Popen([*command, "--link", str(link)], stderr=subprocess.DEVNULL) as bus:
        try:
            until = time.monotonic() + START
            while not link.exists() and time.monotonic() < until:
                time.sleep(0.05)
            figures = folder / "figures.json"
            arguments = ["--backend", "dynamixel", "--port", str(link), "--json", str(figures)]
            code = main(["rise", *arguments])
        finally:
            bus.terminate()
    return code, json.loads(figures.read_text())
