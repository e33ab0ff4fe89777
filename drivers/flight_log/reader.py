"""Flight record: a flight log read back as arrays, whatever of it is intact."""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from drivers.flight_log.foxglove import SCHEMAS
from drivers.flight_log.writer import EVENT, FORMAT, METADATA, TOPICS
from drivers.state import Command, Integers, State
from robots import Posture, Robot
from robots.quaternion import Array
from robots.storage.files import read_bounded
from robots.storage.validation import reading

MOST_BYTES = 1 << 29  # of a file
NEEDED = ("state", "asked", "sent")
OF_JOINTS = {
    "state": ("joint_pos", "joint_vel", "joint_current"),
    "sent": ("joint_pos", "torque_limit"),
}
"""Fields of a number for each joint."""
PACK = 1024  # rows that are held as Python objects before they become an array
MOST_UNPACKED = 1 << 31  # bytes of all its chunks: a flight of an hour
RECORD_HEAD, CHUNK_HEAD, CRC = (struct.Struct(f"<{each}") for each in ("BQ", "QQQ", "I"))
PACKED, PACKED_AT = b"\x04\0\0\0zstd", RECORD_HEAD.size + CHUNK_HEAD.size + CRC.size  # of a chunk
KINDS = set(Opcode)
"""All kinds of records."""
DAMAGE = (
    *(McapError, zstandard.ZstdError, struct.error, EOFError, MemoryError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError),
)
"""Errors that reading a damaged log may raise."""


@dataclass(frozen=True, kw_only=True)
class FlightRecord:
    """A flight log as arrays."""

    path: Path
    robot: str
    joint_names: tuple[str, ...]
    period: float
    """The robot's control period [s]."""
    started: str
    """Date and time of the start, ISO 8601, UTC."""
    about: Mapping[str, str | float | int]
    start: Posture | None
    """Posture of the robot at the first cycle, at rest."""
    tracks: Mapping[str, Track]
    """Parts of a cycle by the names of `Cycle`'s fields; none without a cycle."""
    events: tuple[Event, ...]
    truncated: bool
    """Whether the log is incomplete, as after a kill, or damaged."""
    damage: str = ""
    """Number of damaged records, which are left out, and problem of the first; empty for none."""
    lost_bytes: int
    """Bytes that could not be read."""

    @property
    def cycles(self) -> int:
        """Return the number of cycles."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """Return the time of each cycle on the backend's clock [s], shape (T,)."""
        return self.tracks["state"]["time"] if self.tracks else np.zeros(0)

    @property
    def wall_time(self) -> Integers:
        """Return the wall time of each cycle [ns since 1970], shape (T,)."""
        return self.state.log_time if self.tracks else np.zeros(0, dtype=int)

    @property
    def state(self) -> Track:
        """Return the measurements."""
        return self.tracks["state"]

    @property
    def sent(self) -> Track:
        """Return the commands that reached the servos."""
        return self.tracks["sent"]

    def measurement(self, cycle: int) -> State:
        """Return the measurement of a cycle."""
        return State(**_row(self.state, State, cycle))

    def command(self, cycle: int) -> Command:
        """Return the command that reached the servos in a cycle."""
        return Command(**_row(self.sent, Command, cycle))

    def describe(self) -> str:
        """Summarize the record in one line."""
        seconds = float(self.time[-1] - self.time[0]) if self.cycles else 0.0
        summary = f"{self.robot}: {self.cycles} cycles, {seconds:.2f} s, {len(self.events)} events"
        if not self.truncated:
            return summary
        how = f"damaged ({self.damage})" if self.damage else "cut off"
        return f"{summary}, {how}: {self.lost_bytes} bytes lost"

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> FlightRecord:
        """Load a flight log of a robot, or of any.

        Of one that was cut off or is damaged, all whole chunks are read.

        Raises:
            ValueError: one line with the file and its problem: it is not a flight log, is
                damaged where it says whose it is, is too large, or another robot's.
        """
        with reading(f"flight log {path}"):
            data = read_bounded(path, MOST_BYTES)
            if not data.startswith(MCAP0_MAGIC):
                raise ValueError("not an MCAP file, expected a log of FlightLog")
        try:
            record = _read(path, data)
        except DAMAGE as error:
            raise ValueError(f"flight log {path}: damaged ({explain(error)})") from error
        if robot is not None:
            record.check_robot(robot)
        return record

    def check_robot(self, robot: Robot) -> None:
        """Refuse the log of another robot by a `ValueError`."""
        if self.robot != robot.name:
            problem = f"of robot '{self.robot}', expected '{robot.name}'"
        elif self.joint_names != robot.joint_names:
            problem = (
                f"of a '{robot.name}' with joints {', '.join(self.joint_names)}, "
                f"expected {', '.join(robot.joint_names)}"
            )
        else:
            return
        raise ValueError(f"flight log {self.path}: it is {problem}")


def _row(track: Track, kind: type[State] | type[Command], cycle: int) -> dict[str, Any]:
    row = {one.name: track[one.name][cycle] for one in fields(kind) if one.name in track}
    return {name: value.item() if np.ndim(value) == 0 else value for name, value in row.items()}


def _read(path: Path, data: bytes) -> FlightRecord:
    content = Content(data)
    about, problems = content.about, content.problems
    damage = f"records left out: {len(problems)}, first: {problems[0]}" if problems else ""
    if not about:
        raise ValueError(damage or "it does not name its robot")
    if about["format"] != FORMAT:
        raise ValueError(f"format is '{about['format']}', expected '{FORMAT}'")
    if not about.get("joint_names"):
        raise ValueError("it does not name its joints, expected a log of FlightLog")
    names = {topic: name for name, topic in TOPICS.items()}
    joint_names = tuple(map(str, orjson.loads(about["joint_names"])))
    tracks = {
        names.get(topic, topic.strip("/")): track for topic, track in content.tracks().items()
    }
    if tracks:
        _check_tracks(tracks, len(joint_names))
    is_begun = not tracks or tracks["state"].cycle[0] == 0
    return FlightRecord(
        path=path,
        robot=about["robot"],
        joint_names=joint_names,
        period=float(about["period"]),
        started=about["started"],
        about=orjson.loads(about["about"]),
        start=_parse_posture(about["start"] if is_begun else "", joint_names),
        tracks=tracks,
        events=tuple(content.events),
        truncated=not content.is_complete or bool(damage),
        damage=damage,
        lost_bytes=content.lost_bytes,
    )


def _check_tracks(tracks: dict[str, Track], n: int) -> None:
    cycles = tracks["state"].cycle
    for name in NEEDED:
        if not np.array_equal(tracks[name].cycle, cycles):
            raise ValueError(f"not every cycle has its '{name}'")
    for name, field in ((name, field) for name, these in OF_JOINTS.items() for field in these):
        shape = tracks[name][field].shape
        if shape != (len(cycles), n):
            raise ValueError(f"{name} has {field} of shape {shape}, expected {(len(cycles), n)}")


def _parse_posture(text: str, joint_names: tuple[str, ...]) -> Posture | None:
    if not text:
        return None
    record = json.loads(text)
    record["joint_pos"] = [record["joint_pos"][name] for name in joint_names]
    parts = ("position", "orientation", "joint_pos")
    return Posture(**{part: np.array(record[part], dtype=float) for part in parts})


# Records of the file -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Event:
    """An event of a flight."""

    time: float
    """On the backend's clock [s]."""
    kind: str
    """One word: "fault", "alert", "phase"..."""
    text: str
    cycle: int
    """The first cycle logged after it."""


@dataclass(frozen=True)
class Track:
    """One part of a flight's cycles, a column for each of its fields."""

    cycle: Integers
    """Cycles that have the part, shape (T,)."""
    log_time: Integers
    """Wall times [ns since 1970], shape (T,)."""
    columns: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a field of all cycles, shape (T, ...)."""
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns


class Content:
    """Content of a log without its damaged chunks."""

    def __init__(self, data: bytes) -> None:
        """Read the whole records of a file.

        Raises:
            ValueError: or another error of `DAMAGE`, if what it says of itself is damaged, if it
                unpacks to too much, or if its messages are not those of a flight.
        """
        self.problems: list[str] = []
        """Problem of each damaged record, which is left out."""
        records, self.is_complete, size = _survey(data, self.problems)
        if size > MOST_UNPACKED:
            raise ValueError(f"it unpacks to {size} bytes, expected at most {MOST_UNPACKED}")
        self.about: dict[str, str] = {}
        self.events: list[Event] = []
        self._topic_of: dict[int, str] = {}
        self._topics: dict[str, _Columns] = {}
        self.lost_bytes = len(data) - len(MCAP0_MAGIC) * (2 if self.is_complete else 1)
        """Bytes of the file that were not read."""
        # The index at the end has the channels, too, if the chunk that has them is damaged.
        for at, end in sorted(records, key=lambda record: data[record[0]] != Opcode.CHANNEL):
            if data[at] == Opcode.DATA_END and not self.problems:
                (expected,) = CRC.unpack_from(data, at + RECORD_HEAD.size)
                if expected not in (0, zlib.crc32(memoryview(data)[:at])):
                    raise ValueError("crc validation failed in DataEnd, outside of the chunks")
            try:
                inside = _open(data[at], data[at + RECORD_HEAD.size : end])
            except DAMAGE as error:
                self.problems.append(explain(error))
                continue
            for record in inside:
                self._add(record)
            self.lost_bytes -= end - at

    def tracks(self) -> dict[str, Track]:
        """Return the tracks of all topics but the events."""
        return {topic: columns.track() for topic, columns in self._topics.items()}

    def _add(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            self._add_message(record, self._topic_of.get(record.channel_id, ""))
        elif isinstance(record, Channel):
            self._topic_of[record.id] = record.topic
        elif isinstance(record, Metadata) and record.name == METADATA:
            self.about = record.metadata

    def _add_message(self, record: Message, topic: str) -> None:
        if not topic or topic in SCHEMAS:  # lost; the same values for other programs
            return
        message = orjson.loads(record.data)
        if topic == EVENT:
            time = message.pop("time")
            time = math.nan if time is None else float(time)
            self.events.append(Event(time=time, **message, cycle=record.sequence))
        else:
            if topic not in self._topics:
                self._topics[topic] = _Columns(message)
            self._topics[topic].add(record.sequence, record.log_time, message)


def _survey(data: bytes, problems: list[str]) -> tuple[list[tuple[int, int]], bool, int]:
    """Find begin and end of the whole records, whether a log ends there, and its unpacked size.

    A power cut can leave zeros where the file had grown but was not yet written: no record is of
    kind 0. The size is what the chunks say of themselves; none is unpacked beyond that.
    """
    at, size, found, records = len(MCAP0_MAGIC), 0, 0, list[tuple[int, int]]()
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        after = at + RECORD_HEAD.size + length
        if after > len(data) or opcode not in KINDS:  # the record before may have a wrong length
            last = records[-1][0] if records else at
            found = data.find(PACKED, max(last, found) + PACKED_AT + 1) - PACKED_AT
            if found < 0:
                break
            problems += ["a record has a wrong length"] if found != at else []
            records[-1:] = [(begin, min(end, found)) for begin, end in records[-1:]]
            at = found
            continue
        if opcode == Opcode.CHUNK and length >= CHUNK_HEAD.size:
            size += CHUNK_HEAD.unpack_from(data, at + RECORD_HEAD.size)[2]
        records.append((at, after))
        if opcode == Opcode.FOOTER and data.startswith(MCAP0_MAGIC, after):
            return records, True, size
        at = after
    return records, False, size


def _open(opcode: int, body: bytes) -> list[McapRecord]:
    """Open a record, or all of a chunk; raise an error of `DAMAGE` if it is damaged."""
    stream = ReadDataStream(BytesIO(body))
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        return breakup_chunk(replace(chunk, compression="", data=_unpack(chunk)), validate_crc=True)
    kind = {Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata}.get(Opcode(opcode))
    return [kind.read(stream)] if kind else []


def _unpack(chunk: Chunk) -> bytes:
    """Unpack a chunk, up to the size that it states; raise an error of `DAMAGE` for another."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
    elif chunk.compression:
        raise ValueError(f"a chunk is packed by '{chunk.compression}', expected zstd")
    else:
        data = chunk.data
    if len(data) != size:
        raise ValueError(f"a chunk unpacks to {len(data)} bytes or more, expected {size}")
    return data


def explain(error: Exception) -> str:
    """Return the message of an error in one line."""
    return " ".join(str(error).split())[:200] or type(error).__name__


class _Columns:
    """Collects the messages of a topic as columns."""

    def __init__(self, names: Iterable[str]) -> None:
        self.cycles: list[int] = []
        self.log_times: list[int] = []
        self.rows: dict[str, list[Any]] = {name: [] for name in names}
        self.packs: dict[str, list[np.ndarray]] = {name: [] for name in self.rows}

    def add(self, cycle: int, log_time: int, message: dict[str, Any]) -> None:
        if message.keys() != self.rows.keys():
            raise ValueError(f"cycle {cycle} has other fields than the first")
        self.cycles.append(cycle)
        self.log_times.append(log_time)
        for name, value in message.items():
            self.rows[name].append(value)
        if len(self.cycles) % PACK == 0:
            self._pack()

    def track(self) -> Track:
        self._pack()
        columns = {name: _join(packs) for name, packs in self.packs.items()}
        cycles, times = (np.array(each, dtype=int) for each in (self.cycles, self.log_times))
        return Track(cycles, times, columns)

    def _pack(self) -> None:
        for name, rows in self.rows.items():
            if rows:
                self.packs[name].append(_stack(rows))
                rows.clear()


def _stack(rows: list[Any]) -> np.ndarray:
    """Stack JSON values; null among numbers is NaN, values of different shapes stay a list."""
    try:
        stacked = np.array(rows)
        return stacked.astype(float) if stacked.dtype == object else stacked
    except (ValueError, TypeError):
        return np.fromiter(rows, dtype=object, count=len(rows))


def _join(packs: list[np.ndarray]) -> np.ndarray:
    try:
        return np.concatenate(packs)
    except ValueError:  # a command of another length among valid ones
        return np.fromiter((row for pack in packs for row in pack), dtype=object)
