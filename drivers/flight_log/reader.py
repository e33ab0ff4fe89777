"""Flight record: a flight log read back as arrays."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from drivers.flight_log.writer import EVENT, FORMAT, METADATA, TOPICS
from drivers.state import Command, Integers, State
from robots import Posture, Robot
from robots.quaternion import Array

PACK = 1024  # rows that are held as Python objects before they become an array
UNFILLED = bytes(64)  # no record ends like this


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
    columns: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a field of all cycles, shape (T, ...)."""
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns


class Content:
    """Content of a log."""

    def __init__(self, data: bytes) -> None:
        """Read the whole records at the beginning of a file.

        Raises:
            ValueError: or another error of the decoders, if the data is damaged.
        """
        # A power cut can leave zeros where the file had grown but was not yet written.
        written = data.rstrip(b"\0") if data.endswith(UNFILLED) else data
        end, self.is_complete = _find_end(written)
        self.lost_bytes = len(data) - end
        if self.is_complete and self.lost_bytes:
            raise ValueError(f"{self.lost_bytes} bytes follow its end")
        if not self.is_complete and end > len(MCAP0_MAGIC) and data.endswith(MCAP0_MAGIC):
            raise ValueError(f"the record at byte {end} is longer than the file")
        self.about: dict[str, str] = {}
        self.events: list[Event] = []
        self._topic_of: dict[int, str] = {}
        self._topics: dict[str, _Columns] = {}
        for record in _records(data[:end]):
            self._add(record)

    def tracks(self) -> dict[str, Track]:
        """Return the tracks of all topics but the events."""
        return {topic: columns.track() for topic, columns in self._topics.items()}

    def _add(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            topic, message = self._topic_of[record.channel_id], orjson.loads(record.data)
            if topic == EVENT:
                self.events.append(Event(**message, cycle=record.sequence))
            else:
                if topic not in self._topics:
                    self._topics[topic] = _Columns(message)
                self._topics[topic].add(record.sequence, message)
        elif isinstance(record, Channel):
            self._topic_of[record.id] = record.topic
        elif isinstance(record, Metadata) and record.name == METADATA:
            self.about = record.metadata


def _find_end(data: bytes) -> tuple[int, bool]:
    """Find the end of the last whole record, and whether it is the end of a log."""
    at = len(MCAP0_MAGIC)
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        after = at + 9 + length
        if after > len(data):
            break
        if opcode == Opcode.FOOTER and data.startswith(MCAP0_MAGIC, after):
            return after + len(MCAP0_MAGIC), True
        at = after
    return at, False


def _records(data: bytes) -> Iterator[McapRecord]:
    """Read records; raise if a chunk or a finished log does not match its checksum."""
    stream = BytesIO(data)
    try:
        yield from StreamReader(stream, validate_crcs=True, record_size_limit=None).records
    except EndOfFile:  # a truncated log has no footer
        if stream.tell() < len(data):
            raise


class _Columns:
    """Collects the messages of a topic as columns."""

    def __init__(self, names: Iterable[str]) -> None:
        self.cycles: list[int] = []
        self.rows: dict[str, list[Any]] = {name: [] for name in names}
        self.packs: dict[str, list[np.ndarray]] = {name: [] for name in self.rows}

    def add(self, cycle: int, message: dict[str, Any]) -> None:
        if message.keys() != self.rows.keys():
            raise ValueError(f"cycle {cycle} has other fields than the first")
        self.cycles.append(cycle)
        for name, value in message.items():
            self.rows[name].append(value)
        if len(self.cycles) % PACK == 0:
            self._pack()

    def track(self) -> Track:
        self._pack()
        columns = {name: _join(packs) for name, packs in self.packs.items()}
        return Track(np.array(self.cycles, dtype=int), columns)

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


DAMAGE = (
    *(McapError, zstandard.ZstdError, struct.error, MemoryError, RecursionError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError),
)
"""Errors that reading a damaged log may raise."""
NEEDED = ("state", "asked", "sent")


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
    """Whether the log is incomplete, as after a kill."""
    lost_bytes: int
    """Bytes at the end of a truncated log that could not be read."""

    @property
    def cycles(self) -> int:
        """Return the number of cycles."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """Return the time of each cycle on the backend's clock [s], shape (T,)."""
        return self.tracks["state"]["time"] if self.tracks else np.zeros(0)

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
        # Logs older than this limit do not hold it: it was not limited.
        unlimited = {"pwm_limit": np.ones(len(self.joint_names))}
        return Command(**unlimited | _row(self.sent, Command, cycle))

    def describe(self) -> str:
        """Summarize the record in one line."""
        seconds = float(self.time[-1] - self.time[0]) if self.cycles else 0.0
        summary = f"{self.robot}: {self.cycles} cycles, {seconds:.2f} s, {len(self.events)} events"
        return f"{summary}, cut off ({self.lost_bytes} bytes lost)" if self.truncated else summary

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> FlightRecord:
        """Load a flight log of a robot, or of any; of a truncated one, all whole records.

        Raises:
            ValueError: one line with the file and its problem: it is not a flight log, is
                damaged, or another robot's.
        """
        try:
            with path.open("rb") as file:  # the rest only of what begins like a log
                data = file.read(len(MCAP0_MAGIC))
                is_log = data == MCAP0_MAGIC
                data += file.read() if is_log else b""
        except OSError as error:
            raise ValueError(f"flight log {path}: {error.strerror or error}") from error
        if not is_log:
            raise ValueError(f"flight log {path}: not an MCAP file, expected a log of FlightLog")
        try:
            record = _read(path, data)
        except DAMAGE as error:
            fault = " ".join(str(error).split())[:200] or type(error).__name__
            raise ValueError(f"flight log {path}: damaged ({fault})") from error
        if robot is not None:
            record.check_robot(robot)
        return record

    def check_robot(self, robot: Robot) -> None:
        """Refuse the log of another robot.

        Raises:
            ValueError: naming its robot.
        """
        if self.robot != robot.name:
            fault = f"of robot '{self.robot}', expected '{robot.name}'"
        elif self.joint_names != robot.joint_names:
            fault = (
                f"of a '{robot.name}' with joints {', '.join(self.joint_names)}, "
                f"expected {', '.join(robot.joint_names)}"
            )
        else:
            return
        raise ValueError(f"flight log {self.path}: it is {fault}")


def _row(track: Track, kind: type[State] | type[Command], cycle: int) -> dict[str, Any]:
    row = {one.name: track[one.name][cycle] for one in fields(kind) if one.name in track}
    return {name: value.item() if np.ndim(value) == 0 else value for name, value in row.items()}


def _read(path: Path, data: bytes) -> FlightRecord:
    content = Content(data)
    about = content.about
    if not about:
        raise ValueError("it does not name its robot")
    if about["format"] != FORMAT:
        raise ValueError(f"format is '{about['format']}', expected '{FORMAT}'")
    names = {topic: name for name, topic in TOPICS.items()}
    joint_names = tuple(map(str, orjson.loads(about["joint_names"])))
    tracks = {
        names.get(topic, topic.strip("/")): track for topic, track in content.tracks().items()
    }
    if tracks:
        _check_tracks(tracks, len(joint_names))
    return FlightRecord(
        path=path,
        robot=about["robot"],
        joint_names=joint_names,
        period=float(about["period"]),
        started=about["started"],
        about=orjson.loads(about["about"]),
        start=_parse_posture(about["start"], joint_names),
        tracks=tracks,
        events=tuple(content.events),
        truncated=not content.is_complete,
        lost_bytes=content.lost_bytes,
    )


def _check_tracks(tracks: dict[str, Track], n: int) -> None:
    """Check that each cycle has a measurement and both commands, of n joints."""
    cycles = tracks["state"].cycle
    for name in NEEDED:
        if not np.array_equal(tracks[name].cycle, cycles):
            raise ValueError(f"not every cycle has its '{name}'")
    for name in ("state", "sent"):
        shape = tracks[name]["joint_pos"].shape
        if shape != (len(cycles), n):
            raise ValueError(f"{name} has angles of shape {shape}, expected {(len(cycles), n)}")


def _parse_posture(text: str, joint_names: tuple[str, ...]) -> Posture | None:
    if not text:
        return None
    record = json.loads(text)
    record["joint_pos"] = [record["joint_pos"][name] for name in joint_names]
    parts = ("position", "orientation", "joint_pos")
    return Posture(**{part: np.array(record[part], dtype=float) for part in parts})
