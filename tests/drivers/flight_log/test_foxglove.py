"""Foxglove's messages in a flight log say in wall time and by name what the log says."""

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import orjson
import pytest
from flight_recording import make_cycle, write_flight
from mcap.reader import make_reader
from nonempty import nonempty
from paths import TINY
from tiny_robots import leg, write_robot

from drivers import Command
from drivers.flight_log.foxglove import JOINT_COMMANDS, JOINT_STATES, SCHEMAS, TRANSFORM
from drivers.flight_log.reader import FlightRecord
from robots import Robot, load_robot, quaternion

SECOND = 1_000_000_000
TILTED_IMU = '<site name="imu" quat="0 0.6 0.8 0"/>'


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(TINY)


def read_messages(path: Path, topic: str) -> list[SimpleNamespace]:
    """Read a topic with the reader of the format's authors, by the index of its chunks."""
    with path.open("rb") as file:
        return [
            SimpleNamespace(
                content=orjson.loads(message.data), time=message.log_time, schema=schema
            )
            for schema, _, message in make_reader(file).iter_messages(topics=[topic])
        ]


def test_messages_are_as_their_schemas_say_and_joints_have_the_values_of_the_log(tmp_path, robot):
    cycles = [make_cycle(robot, k) for k in range(5)]
    write_flight(tmp_path / "f", robot, cycles)
    measured = read_messages(tmp_path / "f", JOINT_STATES)
    sent = read_messages(tmp_path / "f", JOINT_COMMANDS)
    for cycle, state, command in nonempty(zip(cycles, measured, sent, strict=True)):
        assert state.schema.name == command.schema.name == "foxglove.JointStates"
        joints = {joint.pop("name"): joint for joint in state.content["joints"]}
        assert tuple(joints) == robot.joint_names
        columns = {key: [joint[key] for joint in joints.values()] for key in joints["l_hip"]}
        assert columns["position"] == cycle.state.joint_pos.tolist()
        assert columns["velocity"] == cycle.state.joint_vel.tolist()
        torque = cycle.state.joint_current * 4.1 / 2.3  # stall torque and current of an XM430-W350
        np.testing.assert_allclose(columns["effort"], torque)
        targets = [joint["position"] for joint in command.content["joints"]]
        assert targets == cycle.sent.joint_pos.tolist()
    for topic in nonempty(SCHEMAS):
        message = read_messages(tmp_path / "f", topic)[1]
        assert message.schema.encoding == "jsonschema"
        check_schema(message.content, orjson.loads(message.schema.data))


def check_schema(value: Any, schema: dict[str, Any]) -> None:
    """Check a value by the words of JSON Schema that the messages use."""
    kinds = {"object": dict, "array": list, "string": str, "number": float, "integer": int}
    assert isinstance(value, kinds[schema["type"]])
    if schema["type"] == "object":
        assert set(schema["required"]) <= value.keys() <= schema["properties"].keys()
        for key, item in value.items():
            check_schema(item, schema["properties"][key])
    for item in value if schema["type"] == "array" else ():
        check_schema(item, schema["items"])
    if schema["type"] == "integer":
        assert schema["minimum"] <= value <= schema.get("maximum", value)


def test_times_are_wall_times_and_the_flight_keeps_its_own(tmp_path, robot):
    first = 4321.0  # of a backend whose clock does not begin with the flight
    before = time.time_ns()
    write_flight(tmp_path / "f", robot, [make_cycle(robot, k, first) for k in range(4)])
    after = time.time_ns()
    record = FlightRecord.load(tmp_path / "f")
    assert record.time.tolist() == [first + k * robot.control_period for k in range(4)]
    assert before <= record.wall_time[0] <= after
    assert np.diff(record.wall_time).tolist() == [8_000_000] * 3
    for topic in nonempty(SCHEMAS):
        messages = read_messages(tmp_path / "f", topic)
        assert [message.time for message in messages] == record.wall_time.tolist()
        stamps = [message.content["timestamp"] for message in messages]
        assert [t["sec"] * SECOND + t["nsec"] for t in stamps] == record.wall_time.tolist()


def test_the_frame_of_the_torso_turns_as_the_torso_does_however_the_imu_is_mounted(tmp_path):
    folder = write_robot(tmp_path / "tilted", leg("l", "0 0.05 0") + leg("r", "0 -0.05 0"))
    model = folder / "model.xml"
    model.write_text(model.read_text("utf-8").replace('<site name="imu"/>', TILTED_IMU), "utf-8")
    robot = load_robot(folder)
    cycle = make_cycle(robot, 1)
    write_flight(tmp_path / "f", robot, [cycle])
    (message,) = read_messages(tmp_path / "f", TRANSFORM)
    frames = [message.content[f"{name}_frame_id"] for name in ("parent", "child")]
    assert frames == ["world", "torso"]
    torso = np.array([message.content["rotation"][axis] for axis in "wxyz"])
    imu = quaternion.multiply(torso, np.array([0.0, 0.6, 0.8, 0.0]))
    np.testing.assert_allclose(imu, cycle.state.orientation, atol=1e-12)


def test_what_is_unknown_and_the_target_of_a_released_servo_are_left_out(tmp_path, robot):
    half = replace(make_cycle(robot, 0).sent, torque_limit=np.array([0.0, 1.0]))
    cycles = [make_cycle(robot, 0, sent=Command.limp(robot.n)), make_cycle(robot, 1, sent=half)]
    write_flight(tmp_path / "g", robot, cycles)
    limp, driven = read_messages(tmp_path / "g", JOINT_COMMANDS)
    assert limp.content["joints"] == []
    assert [joint["name"] for joint in driven.content["joints"]] == ["r_hip"]
    state = replace(
        make_cycle(robot, 0).state,
        joint_pos=np.array([np.nan, 1.0]),
        joint_current=np.array([0.0, np.nan]),
        orientation=np.full(4, np.nan),
    )
    write_flight(tmp_path / "f", robot, [make_cycle(robot, 0, state=state)])
    (message,) = read_messages(tmp_path / "f", JOINT_STATES)
    known = [set(joint) - {"name"} for joint in message.content["joints"]]
    assert known == [{"velocity", "effort"}, {"position", "velocity"}]
    assert read_messages(tmp_path / "f", TRANSFORM) == []
