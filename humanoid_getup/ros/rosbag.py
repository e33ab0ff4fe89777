"""A ROS 2 bag: a folder with an MCAP file of CDR messages, and its metadata."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from mcap_ros2.writer import Writer

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.ros.messages import IMU, JOINT_STATE, MessageType, list_messages
from robots import Robot

METADATA = "metadata.yaml"
TYPES = (JOINT_STATE, IMU)


@dataclass(frozen=True, kw_only=True)
class BagSummary:
    """Content of a bag."""

    start: int
    """Wall time of its first message [ns since 1970]."""
    duration: int
    """[ns]"""
    topics: dict[str, int]
    """Number of messages of each topic."""


def name_file(name: str) -> str:
    """Name the MCAP file of a bag, as ROS 2 does."""
    return f"{name}_0.mcap"


def write_bag(
    record: FlightRecord, robot: Robot, folder: Path, name: str, monitor: ProgressMonitor
) -> BagSummary:
    """Write a flight as a bag into an existing folder; return its content."""
    types, counts = dict[str, MessageType](), Counter[str]()
    with (folder / name_file(name)).open("wb") as file:
        writer = Writer(file)
        schemas = {kind: writer.register_msgdef(kind.name, kind.definition) for kind in TYPES}
        for message in list_messages(record, robot):
            types[message.topic] = message.type
            counts[message.topic] += 1
            writer.write_message(
                message.topic,
                schemas[message.type],
                message.content,
                log_time=message.time,
                sequence=message.cycle,
            )
            monitor.check()
        writer.finish()
    start, end = int(record.wall_time.min()), int(record.wall_time.max())
    summary = BagSummary(start=start, duration=end - start, topics=dict(counts))
    (folder / METADATA).write_text(_describe(summary, types, name_file(name)), "utf-8")
    return summary


def _describe(summary: BagSummary, types: dict[str, MessageType], file: str) -> str:
    """Write metadata.yaml, version 5 of rosbag2."""
    total = sum(summary.topics.values())
    topics = "\n".join(
        f"""    - topic_metadata:
        name: {topic}
        type: {types[topic].name}
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: {count}"""
        for topic, count in summary.topics.items()
    )
    return f"""rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  duration:
    nanoseconds: {summary.duration}
  starting_time:
    nanoseconds_since_epoch: {summary.start}
  message_count: {total}
  topics_with_message_count:
{topics}
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - {json.dumps(file)}
  files:
    - path: {json.dumps(file)}
      starting_time:
        nanoseconds_since_epoch: {summary.start}
      duration:
        nanoseconds: {summary.duration}
      message_count: {total}
"""
