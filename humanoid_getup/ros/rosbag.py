"""A ROS 2 bag: a folder with an MCAP file of a flight's messages in CDR, and its metadata."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer

from drivers.flight_log.foxglove import estimate_joint_torque
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.ros.joint_trajectory import make_stamp
from robots import Robot
from robots.quaternion import Array

MEASURED, COMMANDED, IMU_DATA = "/joint_states", "/joint_commands", "/imu/data"
UNKNOWN = [-1.0, *[0.0] * 8]
"""Covariance of a quantity that is not measured (sensor_msgs/msg/Imu)."""
UNSTATED = [0.0] * 9
"""Covariance of a quantity whose accuracy is not known."""
NEXT = f"{'=' * 80}\nMSG: "
TIME = f"{NEXT}builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
HEADER = f"{NEXT}std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{TIME}"
VECTOR = f"{NEXT}geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = f"{NEXT}geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"


@dataclass(frozen=True)
class MessageType:
    """A type of messages."""

    name: str
    definition: str
    """Its fields and those of the types that it uses, as in a .msg file."""


JOINT_STATE = MessageType(
    "sensor_msgs/msg/JointState",
    "std_msgs/Header header\n"
    "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + HEADER,
)
IMU = MessageType(
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\n"
    "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    + QUATERNION
    + VECTOR
    + HEADER,
)


@dataclass(frozen=True)
class RosMessage:
    """A message of a topic."""

    topic: str
    time: int
    """Wall time [ns since 1970]."""
    cycle: int
    content: dict[str, Any]


def list_messages(record: FlightRecord, robot: Robot) -> Iterator[RosMessage]:
    """Yield the messages of a flight: joints as measured, as commanded, and the IMU.

    Numbers are those of the log. An effort is the torque that a motor's current makes by the data
    sheet; a command has targets of the servos that are not released.
    """
    state, sent = record.state, record.sent
    torque = estimate_joint_torque(robot, state["joint_current"])
    for row, (cycle, time) in enumerate(zip(state.cycle, record.wall_time.tolist(), strict=True)):
        measured = {
            "name": list(robot.joint_names),
            "position": state["joint_pos"][row].tolist(),
            "velocity": state["joint_vel"][row].tolist(),
            "effort": torque[row].tolist(),
        }
        commanded = _describe_targets(robot, sent["joint_pos"][row], sent["torque_limit"][row])
        parts = [(MEASURED, measured, ""), (COMMANDED, commanded, "")]
        turned = _describe_imu(state["orientation"][row], state["gyro"][row])
        if turned is not None:
            parts.append((IMU_DATA, turned, robot.imu_site or ""))
        for topic, content, frame in parts:
            header = {"stamp": make_stamp(time), "frame_id": frame}
            yield RosMessage(topic, time, int(cycle), {"header": header} | content)


def _describe_targets(robot: Robot, target: Array, torque_limit: Array) -> dict[str, Any]:
    driven = np.flatnonzero(torque_limit)
    return {
        "name": [robot.joint_names[k] for k in driven],
        "position": target[driven].tolist(),
        "velocity": [],
        "effort": [],
    }


def _describe_imu(orientation: Array, gyro: Array) -> dict[str, Any] | None:
    """Describe an IMU's measurement; None without IMU, or if it is not finite."""
    if np.shape(orientation) != (4,) or not np.isfinite([*orientation, *gyro]).all():
        return None
    w, x, y, z = orientation.tolist()
    return {
        "orientation": {"x": x, "y": y, "z": z, "w": w},
        "orientation_covariance": UNSTATED,
        "angular_velocity": dict(zip("xyz", gyro.tolist(), strict=True)),
        "angular_velocity_covariance": UNSTATED,
        "linear_acceleration": {"x": 0.0, "y": 0.0, "z": 0.0},
        "linear_acceleration_covariance": UNKNOWN,
    }


METADATA = "metadata.yaml"
TYPES = {MEASURED: JOINT_STATE, COMMANDED: JOINT_STATE, IMU_DATA: IMU}
"""Type of the messages of each topic."""


def write_bag(
    record: FlightRecord, robot: Robot, folder: Path, name: str, monitor: ProgressMonitor
) -> dict[str, int]:
    """Write a flight as a bag into an existing folder; return the number of each topic's messages.

    Its MCAP file is named as by ROS 2.
    """
    file, counts = f"{name}_0.mcap", Counter[str]()
    with (folder / file).open("wb") as stream:
        writer = Writer(stream)
        schemas = {
            kind: writer.register_msgdef(kind.name, kind.definition) for kind in (JOINT_STATE, IMU)
        }
        for message in list_messages(record, robot):
            counts[message.topic] += 1
            writer.write_message(
                message.topic,
                schemas[TYPES[message.topic]],
                message.content,
                log_time=message.time,
                sequence=message.cycle,
            )
            monitor.check()
        writer.finish()
    start, duration = int(record.wall_time.min()), int(np.ptp(record.wall_time))
    (folder / METADATA).write_text(_describe(start, duration, counts, file), "utf-8")
    return dict(counts)


def _describe(start: int, duration: int, counts: Counter[str], file: str) -> str:
    """Write metadata.yaml, version 5 of rosbag2; start and duration are in nanoseconds."""
    topics = "\n".join(
        f"""    - topic_metadata:
        name: {topic}
        type: {TYPES[topic].name}
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: {count}"""
        for topic, count in counts.items()
    )
    return f"""rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  duration:
    nanoseconds: {duration}
  starting_time:
    nanoseconds_since_epoch: {start}
  message_count: {counts.total()}
  topics_with_message_count:
{topics}
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - {json.dumps(file)}
  files:
    - path: {json.dumps(file)}
      starting_time:
        nanoseconds_since_epoch: {start}
      duration:
        nanoseconds: {duration}
      message_count: {counts.total()}
"""
