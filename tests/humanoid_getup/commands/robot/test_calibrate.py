"""`getup calibrate`: a person holds and turns the robot, and its zeros and signs are found."""

import io
import json
import tomllib
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest
from bus_stories import TINY, Served, copy_tiny, serving
from spoiling import spoil

from drivers.service import calibrate as service
from drivers.virtual_bus.devices.servo import VirtualServo
from humanoid_getup.commands.main import main
from humanoid_getup.commands.robot import calibrate as command
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot
from robots.description.calibration import Calibration, JointCalibration
from robots.description.posture_file import format_posture
from robots.kinematics import DIRECTIONS, find_directions, place

L_HIP, R_HIP = JointCalibration(2100, 1), JointCalibration(1000, -1)
"""The robot as it is: the description has zeros 2048 and 1000."""


class Person:
    """Answers what it is asked; each answer may do something to the robot first."""

    def __init__(self, *answers: str | Callable[[], str]) -> None:
        self.answers, self.heard, self.asked = list(answers), [], []

    def tell(self, text: str) -> None:
        self.heard.append(text)

    def ask(self, question: str) -> str:
        self.asked.append(question)
        answer = self.answers.pop(0)
        return answer if isinstance(answer, str) else answer()


@pytest.fixture
def folder(tmp_path) -> Path:
    return copy_tiny(tmp_path)


@pytest.fixture(autouse=True)
def no_pauses(monkeypatch):
    monkeypatch.setattr(service, "PAUSE", 0.0)


@contextmanager
def real_robot(**joints: JointCalibration):
    """Serve the smallest robot with servos that sit otherwise than described."""
    found = {"l_hip": L_HIP, "r_hip": R_HIP} | joints
    robot = Calibration(robot="tiny", joints=found).apply(load_robot(TINY))
    with serving(robot) as served:
        served.place()
        yield served


def turning(served: Served, **angles: float) -> Callable[[], str]:
    """Answer Enter once joints are turned by hand to angles [degrees]."""
    return lambda: served.place(**angles) or ""


@pytest.fixture
def calibrate(folder, capsys, monkeypatch):
    """Calibrate the user's own robot; return exit code and figures."""

    def calibrate(served: Served, person: Person | None, *options: str) -> tuple[int, dict]:
        monkeypatch.setattr(command, "open_prompt", lambda *_: person)
        arguments = ("calibrate", "--robot", str(folder), "--port", served.path, "--json", "-")
        # Named, because a virtual bus does not write the robot's own file by itself.
        out = ("--out", str(folder / "calibration.toml"))
        code = main((*arguments, *(() if "--out" in options else out), *options))
        return code, json.loads(capsys.readouterr().out or "{}")

    return calibrate


def read_saved(folder: Path) -> dict:
    return tomllib.loads((folder / "calibration.toml").read_text())


# Zeros ---------------------------------------------------------------------------------------


def test_a_shifted_zero_is_found_and_saved_after_a_yes_and_angles_are_true(
    folder, calibrate, capsys
):
    with real_robot() as served:
        code, message = calibrate(served, Person("", "no"))
        assert (code, message["saved"]) == (1, None)
        assert not list(folder.glob("calibration*"))
        code, message = calibrate(served, Person("", "yes"))
        assert code == 0
        served.place(l_hip=-30.0, r_hip=20.0)
        main(("doctor", "--robot", str(folder), "--port", served.path, "--json", "-"))
    measured = json.loads(capsys.readouterr().out)["joints"]
    angles = [np.degrees(measured[name]["angle_rad"]) for name in ("l_hip", "r_hip")]
    assert angles == pytest.approx([-30.0, 20.0], abs=0.1)
    left = message["joints"]["l_hip"]
    assert (left["old_zero_ticks"], left["zero_ticks"], left["warnings"]) == (2048, 2100, [])
    assert left["difference_deg"] == pytest.approx(52 * 360 / 4096)
    assert message["joints"]["r_hip"]["difference_deg"] == 0.0
    assert message["saved"] == str(folder / "calibration.toml")
    left, right = ({"zero_ticks": zero, "sign": sign} for zero, sign in ((2100, 1), (1000, -1)))
    assert read_saved(folder) == {"robot": "tiny", "joints": {"l_hip": left, "r_hip": right}}


COUPLING = "\n[[couplings]]\njoints = ['l_hip', 'r_hip']\nmatrix = [[0.9, -0.5], [0.6, -0.7]]\n"


def test_signs_and_zeros_of_coupled_servos_are_found_by_their_own_joints(
    folder, calibrate, tmp_path
):
    """The hips hang on a differential; a servo sits otherwise than described."""
    held = tmp_path / "held.json"
    spoil(folder, "zero_ticks = 1000", "zero_ticks = 2000")  # for ranges within one turn
    spoil(folder, "[bus]", COUPLING + "\n[bus]")
    robot = Calibration(robot="tiny", joints={"l_hip": L_HIP}).apply(load_robot(folder))
    with serving(robot) as served:
        served.place()
        turn = partial(turning, served)
        person = Person(turn(l_hip=20.0), turn(l_hip=20.0, r_hip=20.0), "yes")
        assert calibrate(served, person, "--signs")[0] == 0
        saved = read_saved(folder)["joints"]
        assert (saved["l_hip"]["sign"], saved["r_hip"]["sign"]) == (1, -1)
        standing = replace(robot.standing, joint_pos=np.radians([20.0, -30.0]))
        held.write_text(format_posture(standing, robot))
        served.place(l_hip=20.0, r_hip=-30.0)
        assert calibrate(served, Person("", "yes"), "--at", str(held))[0] == 0
    zeros = [joint["zero_ticks"] for joint in read_saved(folder)["joints"].values()]
    assert zeros == pytest.approx([2100, 2000], abs=1)


# How the torso is held ------------------------------------------------------------------------


def turn_imu(robot: Robot, *axes: str) -> Robot:
    """Describe the board of a robot with other axes."""
    return replace(robot, bus=replace(robot.bus, board=replace(robot.bus.board, imu_axes=axes)))


def test_an_imu_that_is_upside_down_is_named_with_its_axes_and_nothing_is_saved(folder, calibrate):
    with serving(turn_imu(load_robot(TINY), "-x", "y", "-z")) as served:
        served.place()
        person = Person("", "", "")
        assert calibrate(served, person, "--at", "standing")[0] == 2
        assert calibrate(served, None, "--yes", "--at", "standing")[0] == 2
        assert not list(folder.glob("calibration*"))
        assert calibrate(served, None, "--yes", "--at", "zero")[0] == 0, "the torso may lie then"
        spoil(folder, "imu_axes = [-1, -1, 1]", 'imu_axes = ["-x", "y", "-z"]')
        assert calibrate(served, None, "--yes", "--at", "standing")[0] == 0
    message = person.heard[1]
    assert "board 'OpenCR' (id 200): gravity is 180° from that of the posture, expected" in message
    assert 'set bus.board.imu_axes in robot.toml to ["x", "-y", "-z"] or' in message
    assert '["-x", "y", "-z"]' in message


def test_a_robot_that_is_held_otherwise_than_its_posture_is_measured_again(calibrate, tmp_path):
    robot = load_robot(TINY)
    tilted = np.array([np.cos(0.25), 0.0, np.sin(0.25), 0.0])  # 0.5 rad about y, 29°
    held = replace(robot.standing, orientation=tilted)
    (tmp_path / "held.json").write_text(format_posture(held, robot))
    with serving(robot) as served:
        served.place()
        person = Person("", lambda: served.lean(tilted) or "", "yes")
        assert calibrate(served, person, "--at", str(tmp_path / "held.json"))[0] == 0
    assert "gravity is 29° from that of the posture, expected at most 20°: hold" in person.heard[1]
    assert "imu_axes" not in person.heard[1], "no axes make up for it"


# On a virtual bus -----------------------------------------------------------------------------


def test_calibrating_on_a_virtual_bus_leaves_the_robots_calibration_alone(folder, capsys):
    own = 'robot = "tiny"\n[joints.r_hip]\nzero_ticks = 1010\nsign = -1\n'
    (folder / "calibration.toml").write_text(own)
    with real_robot() as served:
        code = main(("calibrate", "--robot", str(folder), "--port", served.path, "--yes"))
    message = " ".join(capsys.readouterr().out.split())
    assert code == 0
    assert (folder / "calibration.toml").read_text() == own
    measured = tomllib.loads((folder / "calibration.virtual.toml").read_text())
    assert measured["joints"]["l_hip"] == {"zero_ticks": 2100, "sign": 1}
    assert "virtual bus" in message and "calibration.virtual.toml" in message
    assert load_robot(folder).joints[1].servo.zero_ticks == 1010


# Limpness and stillness ------------------------------------------------------------------------


def test_a_robot_that_holds_itself_up_goes_limp_only_after_a_yes(calibrate):
    with real_robot() as served:
        served.poke("r_hip", "torque_enable", 1)
        code, _ = calibrate(served, Person("wait"))
        assert code == 1 and served.peek("torque_enable") == [0, 1]
        person = Person("yes", "", "yes")
        code, _ = calibrate(served, person)
        assert code == 0 and served.peek("torque_enable") == [0, 0]
    assert "'r_hip' (id 2) hold the robot up" in person.asked[0]


# Signs ---------------------------------------------------------------------------------------


def test_a_small_turn_is_asked_for_again_and_another_joints_turn_is_named(calibrate):
    with real_robot() as served:
        turn = partial(turning, served)
        both = turn(l_hip=25.0, r_hip=25.0)
        person = Person(turn(l_hip=3.0), turn(l_hip=3.0, r_hip=25.0), both, "no")
        code, message = calibrate(served, person, "--signs", "--joint", "l_hip")
    assert code == 1
    heard = " ".join(person.heard)
    assert "l_hip turned by +3.0° only, expected 5°" in heard
    assert "r_hip turned by -25.0°: are their ids swapped" in heard
    assert message["joints"]["l_hip"]["sign"] == 1


def test_signs_before_zeros_in_one_go_and_a_joint_may_be_left(folder, calibrate):
    with real_robot(l_hip=JointCalibration(2100, -1)) as served:
        turn = partial(turning, served)
        person = Person(turn(l_hip=20.0), "yes", "s", turn(l_hip=-30.0), "yes")
        standing = replace(load_robot(TINY).standing, joint_pos=np.radians([-30.0, 0.0]))
        (folder / "held.json").write_text(format_posture(standing, load_robot(TINY)))
        code, message = calibrate(served, person, "--signs", "--at", str(folder / "held.json"))
    assert code == 0
    assert person.asked[0].startswith("turn l_hip in its positive direction (the far end of")
    assert "sign -1 contradicts the known +1" in person.asked[1]
    assert person.asked[2].startswith("turn r_hip")
    assert any("other way" in w for w in message["joints"]["l_hip"]["warnings"])
    saved = read_saved(folder)["joints"]
    assert saved["l_hip"]["sign"] == -1
    assert saved["l_hip"]["zero_ticks"] == pytest.approx(2100, abs=1)
    assert saved["r_hip"] == {"zero_ticks": 1000, "sign": -1}


def test_directions_in_words_are_those_of_the_model(op3: Robot, world: World):
    """How a joint's farthest geometry moves in the world when it turns by 1 mrad."""
    model, checked = world.model, 0
    data, stance = mujoco.MjData(model), place(op3, model, op3.standing)
    for joint in op3.joints:
        message = str(find_directions(op3)[joint.name])
        if "seen from above" in message:
            continue
        places = []
        for angle in (0.0, 1e-3):
            data.qpos[:] = stance
            data.joint(joint.name).qpos[0] += angle
            mujoco.mj_kinematics(model, data)
            places.append(data.geom_xpos.copy())
        moved = places[1] - places[0]
        far = np.linalg.norm(places[0] - data.joint(joint.name).xanchor, axis=1)
        way = moved[int((far * (np.linalg.norm(moved, axis=1) > 1e-9)).argmax())]
        largest = int(np.abs(way).argmax())
        assert message.endswith(DIRECTIONS[largest][int(way[largest] > 0.0)]), joint.name
        checked += 1
    assert checked > 10
    assert str(find_directions(op3)["head_pan"]).endswith("turns counter-clockwise")
    assert str(find_directions(op3)["r_knee"]).endswith("forward")


# Refusals ------------------------------------------------------------------------------------


def refuse(capsys, *arguments: str, code: int = 2) -> str:
    """Return the one line of a refusal."""
    assert main(("calibrate", *arguments)) == code
    out, error = capsys.readouterr()
    assert out == "" and error.startswith("getup: ") and error.count("\n") == 1
    return error


def test_without_a_terminal_it_needs_a_yes_and_signs_need_a_person(folder, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    mine = ("--robot", str(folder), "--port", "/dev/nowhere")
    assert "standard input is not a terminal: it cannot ask" in refuse(capsys, *mine)
    assert "--signs needs a person" in refuse(capsys, *mine, "--signs", "--yes")


def test_a_dead_or_another_servo_is_refused_but_only_where_it_was_chosen(folder, capsys):
    mine = ("--robot", str(folder), "--yes")
    with real_robot() as served:
        port = ("--port", served.path)
        served.exchange(1, VirtualServo(2, "XL430-W250", baud=1_000_000))
        message = refuse(capsys, *mine, *port, code=3)
        assert "joint 'r_hip' (id 2): is a XL430-W250, expected XM430-W350" in message
        served.virtual.servos[0].alive = False
        message = refuse(capsys, *mine, *port, "--joint", "l_hip", code=3)
        assert "'l_hip' (id 1)" in message and "silent" in message
        assert not list(folder.glob("calibration*"))
