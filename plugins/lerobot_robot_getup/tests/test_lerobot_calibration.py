"""LeRobot's calibration files: there and back again, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("lerobot.robots", reason="needs LeRobot", exc_type=ImportError)

import draccus
from lerobot.motors import MotorCalibration
from lerobot_robot_getup.__main__ import main
from lerobot_robot_getup.lerobot_calibration import find_calibration, save_calibration

from robots import Robot, load_robot
from robots.description.calibration import Calibration, JointCalibration


@pytest.fixture
def measured(op3: Robot) -> Robot:
    """A robot whose zeros were measured, and one of whose servos turns the other way."""
    joints = {
        name: JointCalibration(2048 + 7 * i, -1 if name == "head_tilt" else 1)
        for i, name in enumerate(op3.joint_names)
    }
    return Calibration(robot="op3", joints=joints).apply(op3)


def test_a_robot_survives_the_trip_through_lerobots_file(
    measured: Robot, op3: Robot, tmp_path: Path
):
    file, back = tmp_path / "op3.json", tmp_path / "calibration.toml"
    save_calibration(find_calibration(measured), file)
    arguments = ["calibration", "from-lerobot", str(file), "--out", str(back)]
    assert main([*arguments, "--directions", "file"]) == 0
    again = Calibration.load(back, op3).apply(op3)
    assert [j.servo for j in again.joints] == [j.servo for j in measured.joints]


@pytest.mark.parametrize("name", ["op3", "toddlerbot", "wolfgang"])
def test_lerobot_loads_the_file(name: str, tmp_path: Path):
    robot, file = load_robot(name), tmp_path / "calibration.json"
    out = ["calibration", "to-lerobot", "--robot", name, "--out", str(file)]
    assert main(out) == 0
    with file.open() as stream, draccus.config_type("json"):
        loaded = draccus.load(dict[str, MotorCalibration], stream)
    assert loaded == find_calibration(robot)
    assert list(loaded) == list(robot.joint_names)


def test_a_posture_in_which_servos_were_homed_is_taken_off(op3: Robot, tmp_path: Path):
    """LeRobot homes where a robot is: here it stood, with its zeros at 2048."""
    calibration = find_calibration(op3)
    for joint, angle in zip(op3.joints, op3.standing.joint_pos, strict=True):
        homed = joint.servo.to_ticks(float(angle))
        calibration[joint.name] = replace(calibration[joint.name], homing_offset=2047 - homed)
    file, back = tmp_path / "op3.json", tmp_path / "calibration.toml"
    save_calibration(calibration, file)
    arguments = ["calibration", "from-lerobot", str(file), "--homed-at", "standing"]
    assert main([*arguments, "--out", str(back)]) == 0
    found = Calibration.load(back, op3).joints
    assert {name: each.zero_ticks for name, each in found.items()} == {
        joint.name: joint.servo.zero_ticks for joint in op3.joints
    }


GOOD = {"id": 19, "drive_mode": 0, "homing_offset": -1, "range_min": 1000, "range_max": 3000}
BAD = [
    ({"head_pan": GOOD | {"id": 7}}, "joint 'head_pan': id is 7, expected 19"),
    ({"neck": GOOD}, "unknown joint 'neck', expected those of robot 'op3'"),
    ({"head_pan": GOOD | {"drive_mode": 1}}, "drive_mode is 1, expected 0 as robot 'op3' turns it"),
    ({"head_pan": GOOD | {"range_min": 3000}}, "range_min is 3000 ticks, expected less than"),
    ({"head_pan": GOOD | {"homing_offset": "left"}}, "expected LeRobot's calibration"),
    ({"head_pan": {"id": 19}}, "missing required field"),
    ([GOOD], "expected LeRobot's calibration"),
]


@pytest.mark.parametrize(("content", "message"), BAD)
def test_a_file_that_does_not_fit_is_refused_in_one_line(
    content, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    file, back = tmp_path / "op3.json", tmp_path / "calibration.toml"
    file.write_text(json.dumps(content))
    code = main(["calibration", "from-lerobot", str(file), "--out", str(back)])
    assert code in (2, 3)
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not back.exists()


def test_a_range_that_crosses_its_servos_turn_is_saved_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    file, back = tmp_path / "op3.json", tmp_path / "calibration.toml"
    file.write_text(json.dumps({"head_pan": GOOD | {"homing_offset": 2000}}))
    assert main(["calibration", "from-lerobot", str(file), "--out", str(back)]) == 0
    assert "beyond one turn of its servo" in capsys.readouterr().out
    assert back.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["to-lerobot", "--robot", "no_robot", "--out", "x.json"], "no_robot"),
        (["to-lerobot", "--out", "no_folder/x.json"], "no_folder"),
        (["from-lerobot", "no_file.json", "--out", "x.toml"], "no_file.json"),
    ],
)
def test_names_that_do_not_exist_are_refused_in_one_line(
    arguments, message: str, capsys: pytest.CaptureFixture[str]
):
    assert main(["calibration", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
