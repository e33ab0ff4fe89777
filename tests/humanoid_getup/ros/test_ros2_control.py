"""A robot as the ROS 2 plugin for Dynamixels would move it is the robot of its description."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from nonempty import nonempty
from paths import TINY

from humanoid_getup.commands.main import main
from humanoid_getup.commands.robot.export_robot import ExportRobotRequest, export_robot
from robots import Robot, load_robot
from robots.quaternion import Array

TICK = 2.0 * math.pi / 4096


@dataclass(frozen=True)
class Plugin:
    """The parts of a `<ros2_control>` that decide which ticks a servo receives."""

    names: list[str]
    ids: list[int]
    to_servo: Array
    to_joint: Array
    registers: list[dict[str, int]]
    baud: int

    @classmethod
    def read(cls, system: ElementTree.Element) -> "Plugin":
        def parameters(element: ElementTree.Element) -> dict[str, str]:
            return {each.attrib["name"]: each.text or "" for each in element.findall("param")}

        hardware = system.find("hardware")
        assert hardware is not None
        assert hardware.findtext("plugin") == "dynamixel_hardware_interface/DynamixelHardware"
        about = parameters(hardware)
        servos = [parameters(each) for each in system.findall("gpio")]
        n = int(about["number_of_joints"])
        assert n == int(about["number_of_transmissions"]) == len(servos)
        square = [
            np.array([float(x) for x in about[f"{name}_matrix"].split(",")]).reshape(n, n)
            for name in ("joint_to_transmission", "transmission_to_joint")
        ]
        return cls(
            names=[each.attrib["name"] for each in system.findall("joint")],
            ids=[int(servo["ID"]) for servo in servos],
            to_servo=square[0],
            to_joint=square[1],
            registers=[{k: int(v) for k, v in servo.items() if k != "type"} for servo in servos],
            baud=int(about["baud_rate"]),
        )

    def find_ticks(self, joint_pos: Array) -> list[int]:
        """Return the ticks of the encoders at which the joints are where they are sent."""
        goal = 2048 + self.to_servo @ joint_pos / TICK
        homing = [registers.get("Homing Offset", 0) for registers in self.registers]
        return [round(g) - h for g, h in zip(goal, homing, strict=True)]


def export(robot: str, folder: Path, **options: object) -> list[Plugin]:
    request = ExportRobotRequest(robot=robot, ros2_control=folder, **options)  # pyright: ignore[reportArgumentType]
    found = export_robot(request)
    root = ElementTree.parse(found.files[0]).getroot()
    return [Plugin.read(system) for system in nonempty(root.iter("ros2_control"))]


@pytest.mark.parametrize("name", ["op3", "toddlerbot", str(TINY)])
def test_servos_receive_the_ticks_that_our_driver_sends(name: str, tmp_path: Path):
    robot = load_robot(name)
    rng = np.random.default_rng(2)
    seen = []
    for plugin in export(name, tmp_path / "control"):
        rows = [robot.joint_names.index(joint) for joint in plugin.names]
        seen += rows
        assert plugin.ids == [robot.joints[k].servo.id for k in rows]
        np.testing.assert_allclose(plugin.to_servo @ plugin.to_joint, np.eye(len(rows)), atol=1e-6)
        for joint_pos in rng.uniform(robot.lower, robot.upper, (20, robot.n)):
            at_servo = robot.transmission.to_actuator(joint_pos)
            ours = [robot.joints[k].servo.to_ticks(float(at_servo[k])) for k in rows]
            theirs = plugin.find_ticks(joint_pos[rows])
            np.testing.assert_allclose(theirs, ours, atol=1)  # of a tick, where both round
    assert sorted(seen) == list(range(robot.n))
    if robot.name == "tiny":  # a zero elsewhere is a homing offset
        assert [each.get("Homing Offset") for each in plugin.registers] == [None, 1048]
        text = (tmp_path / "control" / "ros2_control.xacro").read_text("utf-8")
        assert "become homing offsets in the EEPROM (r_hip)" in text


@pytest.mark.parametrize(
    ("options", "register", "value"),
    [
        ({}, "Goal Current", 855),  # by hand: 2.3 A of stall in steps of 2.69 mA
        ({"limit_by": "pwm", "torque_limit": 2.05}, "Goal PWM", 442),
    ],
)
def test_the_torque_limit_is_in_the_register_of_its_mode(
    options: dict[str, object], register: str, value: int, tmp_path: Path, op3: Robot
):
    (plugin,) = export("op3", tmp_path / "control", **options)
    assert plugin.baud == 2_000_000
    mode = 5 if register == "Goal Current" else 4
    for registers, joint in nonempty(zip(plugin.registers, op3.joints, strict=True)):
        assert registers["Operating Mode"] == mode
        assert registers[register] == value
        assert registers["Position P Gain"] == joint.servo.p_gain
        assert ("Position D Gain" in registers) == (mode == 5)


def test_controllers_have_the_joints_and_the_rate_of_the_robot(tmp_path: Path, op3: Robot):
    yaml = pytest.importorskip("yaml")
    export("op3", tmp_path / "control")
    content = yaml.safe_load((tmp_path / "control" / "controllers.yaml").read_text("utf-8"))
    manager = content["controller_manager"]["ros__parameters"]
    assert manager["update_rate"] == 125
    controllers = {name: each["type"] for name, each in manager.items() if isinstance(each, dict)}
    assert controllers == {
        "joint_state_broadcaster": "joint_state_broadcaster/JointStateBroadcaster",
        "joint_trajectory_controller": "joint_trajectory_controller/JointTrajectoryController",
    }
    parameters = content["joint_trajectory_controller"]["ros__parameters"]
    assert tuple(parameters["joints"]) == op3.joint_names
    assert set(op3.joint_names) < set(parameters["constraints"])


def test_what_it_cannot_express_is_printed_and_in_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = ["robots", "export", "op3", "--ros2-control", str(tmp_path / "control")]
    assert main([*words, "--json", str(tmp_path / "result.json")]) == 0
    lines = capsys.readouterr().out
    text = (tmp_path / "control" / "ros2_control.xacro").read_text("utf-8")
    notes = json.loads((tmp_path / "result.json").read_text())["notes"]
    assert any("the board switches the servos' power" in note for note in notes)
    for note in nonempty(notes):
        assert f"note: {note}" in lines
        assert note in text
