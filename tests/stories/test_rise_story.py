"""The main job through its real parts: a fall, a plan, the filter, the twin, a held stand."""

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from stored_plans import lie_at_start

from drivers import Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import HARDWARE_FAULT
from humanoid_getup.commands.get_up.play import PlayRequest
from humanoid_getup.commands.get_up.results import finish_rise, print_rise
from humanoid_getup.commands.main import main
from humanoid_getup.commands.options import with_json
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.reporting.film_strip import NoRendererError, render_frames
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import StoredMotion
from robots import Robot
from robots.description.posture_file import format_posture
from robots.kinematics import place
from robots.servo import RAD_PER_TICK

MOTION, SQUAT = "supine_sit_up_fast", "squat_to_stand"
LIMIT = 3.0  # N·m
SEEDED = ("rise", "--from", "supine", "--seed", "1", "--torque-limit", f"{LIMIT}")


@pytest.fixture(scope="module")
def risen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that one rise from a supine fall leaves behind."""
    out = tmp_path_factory.mktemp("rise") / "new" / "out"
    code = main([*SEEDED, "--out", str(out), "--json", str(out / "figures.json")])
    assert code == 0
    return out


@pytest.fixture(scope="module")
def report(risen: Path) -> dict:
    return json.loads((risen / "report.json").read_text())


def has_gl(robot: Robot, world: World) -> bool:
    try:
        render_frames(robot, world.model, place(robot, world.model, robot.standing)[None])
    except NoRendererError:
        return False
    return True


def test_a_fallen_robot_gets_up(report: dict):
    assert (report["robot"], report["seed"], report["start_class"]) == ("op3", 1, "supine")
    assert (report["planned"], report["stood"], report["attempts"]) == (True, True, 1)
    assert report["reason"] == "held stand"
    assert report["hold_s"] >= HOLD_TIME
    assert 0.5 < report["stand_time_s"] < 15.0
    assert 0.0 < report["peak_torque_nm"] <= LIMIT + 1e-9
    assert report["torque_use"] == pytest.approx(report["peak_torque_nm"] / LIMIT)
    assert report["limit_violations"] == 0


def test_everything_lies_in_the_output_folder(risen: Path, report: dict, op3: Robot, world: World):
    pictures = ["strip.png", "torque.png"] if has_gl(op3, world) else ["torque.png"]
    expected = ["figures.json", "flight.mcap", "motion.npz", "report.json", *pictures]
    assert sorted(path.name for path in risen.iterdir()) == sorted(expected)
    assert [path.name for path in risen.parent.iterdir()] == ["out"]
    assert (report["strip_reason"] is None) == ("strip.png" in pictures)
    assert json.loads((risen / "figures.json").read_text()) == report


def test_the_motion_of_a_rise_can_be_played_again(risen, tmp_path, op3, capsys):
    motion = Motion.load(risen / "motion.npz")
    fallen = tmp_path / "fallen.json"
    fallen.write_text(format_posture(motion.posture(0), op3))
    arguments = ["play", str(risen / "motion.npz"), "--from", str(fallen)]
    assert main([*arguments, "--torque-limit", f"{LIMIT}", "--json", "-"]) == 0
    out, error = capsys.readouterr()
    again = json.loads(out)  # JSON alone
    assert (again["motion"], again["start_class"]) == (motion.name, "supine")
    assert (again["stood"], again["planned"]) == (True, False)
    assert error.startswith("stood after ")


def test_a_motion_that_does_not_fit_the_fall_is_refused(world: World, tmp_path: Path):
    figures, fallen_prone = tmp_path / "figures.json", tmp_path / "prone.json"
    fallen_prone.write_text(format_posture(lie_at_start(world), world.robot))
    play = ["play", MOTION, "--from", str(fallen_prone), "--json", str(figures)]
    assert main(play) == 1
    refused = json.loads(figures.read_text())
    assert (refused["stood"], refused["start_class"], refused["attempts"]) == (False, "prone", 0)
    assert "it lies prone, the motion begins supine" in refused["reason"]


def test_a_motion_plays_alike_through_the_command_and_from_the_library(played, tmp_path):
    figures = tmp_path / "figures.json"
    assert main(["play", SQUAT, "--json", str(figures)]) == 0
    report = json.loads(figures.read_text())
    assert report["stand_time_s"] == played.figures().stand_time_s
    assert report["peak_torque_nm"] == played.figures().peak_torque_nm


@pytest.mark.usefixtures("no_film")
def test_the_rise_is_the_same_over_the_bus(risen: Path, report: dict, op3: Robot, tmp_path: Path):
    figures = tmp_path / "figures.json"
    out = ("--json", str(figures), "--out", str(tmp_path))
    assert main([*SEEDED, "--then", "limp", "--backend", "virtual", *out]) == 0
    on_bus = json.loads(figures.read_text())
    for key in ("stood", "stand_time_s", "peak_torque_nm", "connection", "rollouts"):
        assert on_bus[key] == report[key], key
    assert (on_bus["backend"], on_bus["judged_by"]) == ("virtual", "truth")
    records = [FlightRecord.load(each / "flight.mcap", op3) for each in (risen, tmp_path)]
    paths = [record.state["joint_pos"] for record in records]
    assert len(paths[0]) == len(paths[1]) > 500
    assert np.abs(paths[0] - paths[1]).max() < RAD_PER_TICK


@pytest.mark.parametrize(("by_fault", "code"), [(True, 3), (False, 1)])
def test_a_fault_of_the_hardware_has_its_own_exit_code(played, world, tmp_path, by_fault, code):
    ended = replace(played, status=AttemptStatus.NEEDS_HELP, by_fault=by_fault)
    options: Any = with_json(PlayRequest)(motion=MOTION, json=str(tmp_path / "figures.json"))
    done = finish_rise(ended, None, world, options)
    assert print_rise(done, options, Console()) == code


@pytest.fixture(scope="module")
def played(op3: Robot, world: World) -> Rise:
    """A squat that stood up, played as it is stored."""
    squat = find_motion(op3, SQUAT)
    twin = Twin(world, lie_at_start(world, SQUAT))
    strategy = StoredMotion(world, squat)
    options = SessionOptions(settle=False)
    result = get_up(twin, strategy, max_attempts=1, options=options)
    assert result.stood
    return result


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("origin", ["supine", "prone", "left", "right"])
def test_a_fallen_op3_gets_up(origin, seed, tmp_path):
    out = tmp_path / "rise"
    assert main(["rise", "--from", origin, "--seed", str(seed), "--out", str(out)]) == 0
    report = json.loads((out / "report.json").read_text())
    assert report["start_class"] == origin
    assert report["planned"]
    assert report["stood"]
    assert report["hold_s"] >= 3.0
    assert report["stand_time_s"] < 8.0
    assert report["limit_violations"] == 0
    assert report["clips"] == 0
    assert (out / "motion.npz").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("origin", ["supine", "prone", "left"])
def test_a_weak_op3_gets_up_too(origin, tmp_path):
    code = main(["rise", "--from", origin, "--torque-limit", "2.5", "--out", str(tmp_path / "r")])
    assert code == 0
    report = json.loads((tmp_path / "r" / "report.json").read_text())
    assert report["peak_torque_nm"] <= 2.5


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
