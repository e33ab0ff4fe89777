"""A bag of a flight says to programs of others, to the last bit, what the log says."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nonempty import nonempty

pytest.importorskip("mcap_ros2", reason="the extra ros is not installed")
pytest.importorskip("rosbags", reason="the reader of others is not installed")

from flight_recording import record_swing, twin_of
from paths import TINY
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from drivers import Command, Cycle
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.look.export_log import ExportLogRequest, export_log
from humanoid_getup.commands.main import main
from robots import Robot

TYPES = get_typestore(Stores.ROS2_HUMBLE)
"""The messages as ROS defines them, not as the bag says."""


def read_topic(bag: Path, topic: str) -> list[tuple[int, Any]]:
    """Read time and content of the messages of a topic."""
    with Reader(bag) as reader:
        connections = [each for each in reader.connections if each.topic == topic]
        return [
            (time, TYPES.deserialize_cdr(data, connection.msgtype))
            for connection, time, data in reader.messages(connections)
        ]


@pytest.fixture(scope="module")
def bag(swing: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    bag = tmp_path_factory.mktemp("bags") / "swing"
    export_log(ExportLogRequest(log=swing, rosbag2=bag, robot=str(TINY)))
    return bag


def count_nanoseconds(header: Any) -> int:
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def test_a_bag_has_every_cycle_with_joints_by_name_and_wall_times(bag: Path, swing: Path):
    record = FlightRecord.load(swing)
    states, commands = read_topic(bag, "/joint_states"), read_topic(bag, "/joint_commands")
    assert [time for time, _ in states] == record.wall_time.tolist()
    for row, (time, state) in enumerate(nonempty(states)):
        assert count_nanoseconds(state.header) == time
        assert tuple(state.name) == record.joint_names
        assert np.array_equal(state.position, record.state["joint_pos"][row])
        assert np.array_equal(state.velocity, record.state["joint_vel"][row])
        torque = record.state["joint_current"][row] * 4.1 / 2.3  # data sheet of the XM430-W350
        np.testing.assert_allclose(state.effort, torque)
    for row, (_, command) in enumerate(nonempty(commands)):
        assert tuple(command.name) == record.joint_names
        assert np.array_equal(command.position, record.sent["joint_pos"][row])
    with Reader(bag) as reader:
        assert reader.start_time == record.wall_time[0]
        # Readers count the nanosecond of the last message.
        assert reader.duration == record.wall_time[-1] - record.wall_time[0] + 1
        counts = {each.topic: each.msgcount for each in reader.connections}
    topics = ("/joint_states", "/joint_commands", "/imu/data")
    assert counts == dict.fromkeys(topics, record.cycles)


def test_a_silent_servo_is_nan_a_released_one_has_no_target_and_a_silent_imu_no_sample(
    tiny: Robot, tmp_path: Path
):
    def spoil(cycle: Cycle) -> Cycle:
        state = replace(cycle.state, joint_pos=np.array([np.nan, 0.5]))
        if cycle.state.time > 0.5:
            return replace(cycle, state=replace(state, orientation=np.full(4, np.nan)))
        return replace(cycle, state=state, sent=Command.limp(2))

    record_swing(tmp_path / "f.mcap", tiny, twin_of(tiny), tiny.standing, spoil)
    found = export_log(
        ExportLogRequest(log=tmp_path / "f.mcap", rosbag2=tmp_path / "bag", robot=str(TINY))
    )
    _, state = read_topic(tmp_path / "bag", "/joint_states")[0]
    assert np.isnan(state.position[0])
    assert state.position[1] == 0.5
    first, last = (read_topic(tmp_path / "bag", "/joint_commands")[k][1] for k in (0, -1))
    assert (first.name, len(first.position)) == ([], 0)
    assert tuple(last.name) == tiny.joint_names
    assert 0 < found.topics["/imu/data"] < found.topics["/joint_states"]


def test_the_command_prints_topics_and_the_next_step(
    swing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = ["log", "export", str(swing), "--robot", str(TINY), "--rosbag2", str(tmp_path / "bag")]
    assert main(words) == 0
    lines = capsys.readouterr().out
    assert "/joint_states: 125 messages" in lines
    assert f"next: ros2 bag info {tmp_path / 'bag'}" in lines
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == [
        "bag_0.mcap",
        "metadata.yaml",
    ]
    assert main(words) == 2
    assert "which is not empty, expected a new folder" in capsys.readouterr().err


def test_a_log_that_was_cut_off_is_exported_as_far_as_it_is_whole(swing: Path, tmp_path: Path):
    data = swing.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    found = export_log(
        ExportLogRequest(log=tmp_path / "cut.mcap", rosbag2=tmp_path / "bag", robot=str(TINY))
    )
    assert found.truncated
    assert 0 < found.topics["/joint_states"] < FlightRecord.load(swing).cycles
    assert len(read_topic(tmp_path / "bag", "/joint_states")) == found.topics["/joint_states"]
