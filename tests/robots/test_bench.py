"""Servos on a bench: a robot without a body, for whatever needs none."""

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from bus_stories import run_json, serving

from drivers import Command, Twin
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import load_robot as load_for_command
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.commands.robot.bus import list_bench_servos
from robots import RobotError, load_robot
from robots.bench import Load, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models

DESK = """
name = "desk"
bench = [
  { id = 1, servo = "XL430-W250" },
  { id = 7, servo = "XM430-W350", name = "arm", lower = -1.0, upper = 0.5, load_mass = 0.2 },
]
[bus]
baud = 57600
"""


def write_desk(folder: Path, old: str = "", new: str = "") -> Path:
    (folder / "robot.toml").write_text(DESK.replace(old, new) if old else DESK)
    return folder


def test_a_folder_without_a_model_describes_servos_on_a_bench(tmp_path: Path):
    desk = load_robot(write_desk(tmp_path))
    assert desk.joint_names == ("servo_1", "arm")
    assert [joint.servo.id for joint in desk.joints] == [1, 7]
    np.testing.assert_allclose(desk.lower, [-math.pi, -1.0])
    np.testing.assert_allclose(desk.upper, [math.pi - math.tau / 4096, 0.5])
    assert desk.bus is not None
    assert desk.bus.ports == {"main": ("servo_1", "arm")}
    assert desk.limit_by == "pwm"  # the XL430 has no current sensor


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("id = 7", "id = 1", "id 1 is given 2 times, expected once"),
        ("XM430-W350", "XM999", "servo is 'XM999', expected"),
        ("lower = -1.0", "lower = 1.0", "lower is 1 rad, expected below upper, 0.5 rad"),
        ("load_mass = 0.2", "load_mass = 200", "load_mass is 200 kg, expected 0 to 20 kg"),
        ("baud = 57600", "baud = 57601", "bus.baud is 57601"),
        ("id = 7", "id = 7, torso = 'arm'", "unknown key"),
    ],
)
def test_a_wrong_bench_is_refused_with_its_place(tmp_path: Path, old: str, new: str, expected: str):
    with pytest.raises(RobotError) as refused:
        load_robot(write_desk(tmp_path, old, new))
    assert expected in str(refused.value)


def test_a_command_that_needs_a_body_refuses_a_bench(tmp_path: Path):
    request = RobotOption(robot=str(write_desk(tmp_path)))
    with pytest.raises(BadInputError, match="servos on a bench, expected a robot with a model"):
        load_for_command(request)
    assert load_for_command(request, takes_bench=True).name == "desk"


def test_a_load_on_a_limp_servo_swings_down_and_its_weight_is_the_torque_that_holds_it():
    joint = make_bench_joint(servo_models()["XL430-W250"], 1)
    bench = make_bench([joint], baud=57_600, loads=[Load(mass=1.0, arm=0.1)])
    with Twin(bench, without_imu=True) as twin:
        twin.place(replace(bench.standing, joint_pos=np.array([math.pi / 2])))
        for _ in range(round(10.0 / bench.control_period)):
            twin.write(Command.limp(1))
        angle = twin.read().joint_pos[0]
    weight = 1.0 * 9.81 * 0.1  # N·m of a kilogram on a horizontal arm
    friction = bench.joints[0].servo.model.friction
    assert abs(weight * math.sin(angle)) < 1.05 * friction  # which holds it where it stops
    model = bench.spec().compile()
    data = mujoco.MjData(model)
    data.joint("servo_1").qpos[0] = math.pi / 2
    mujoco.mj_forward(model, data)
    assert abs(data.qfrc_bias[model.joint("servo_1").dofadr[0]]) == pytest.approx(weight, rel=1e-3)


def test_servos_of_a_command_line_are_models_with_their_ids():
    joints = list_bench_servos(("XL430-W250:1", "2", "XM430-W350:3"))
    models = {joint.servo.id: joint.servo.model.name for joint in joints}
    assert models == {1: "XL430-W250", 2: "XL430-W250", 3: "XM430-W350"}
    for words, expected in (
        (("1", "XL430-W250:2"), "has '1', expected MODEL:ID"),
        (("XL43-W250:1",), "MODEL:ID with a model of XL430-W250, "),
        (("ax12a:1",), "MODEL:ID with a model of AX-12A, "),
        (("XL430-W250:253",), "expected an id from 0 to 252"),
        (("XL430-W250:one",), "expected an id from 0 to 252"),
        (("XL430-W250:1", "1"), "has the id 1 twice"),
    ):
        with pytest.raises(ValueError, match=expected):
            list_bench_servos(words)


def test_a_bench_is_diagnosed_as_any_robot_and_needs_no_imu(tmp_path: Path, capsys):
    folder = write_desk(tmp_path)
    with serving(load_robot(folder)) as served:
        where = ("--robot", str(folder), "--port", served.path)
        code, health = run_json("doctor", *where, capsys=capsys)
    assert code == 0
    assert health["healthy"]
    assert {name: joint["model"] for name, joint in health["joints"].items()} == {
        "servo_1": "XL430-W250",
        "arm": "XM430-W350",
    }
    assert not [finding for finding in health["findings"] if "IMU" in str(finding)]
