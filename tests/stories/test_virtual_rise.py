"""`getup rise --backend virtual`: through the real driver, over a serial port, to a stand."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from humanoid_getup.commands.errors import HARDWARE_FAULT
from humanoid_getup.commands.main import main

START = 60.0  # s that a program may take until it serves or has played


@pytest.mark.slow  # half a minute
@pytest.mark.parametrize("start", ["supine", "prone", "left", "right"])
def test_a_fallen_robot_gets_up_over_the_bus_from_every_side(start: str, tmp_path: Path):
    figures = tmp_path / "figures.json"
    assert main(["rise", "--from", start, "--backend", "virtual", "--json", str(figures)]) == 0
    report = json.loads(figures.read_text())
    assert (report["stood"], report["backend"]) == (True, "virtual")
    assert (report["judged_by"], report["attempts"]) == ("truth", 1)
    assert report["stand_time_s"] < 10.0  # crossed limbs take a try more, within one plan


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
