"""Flight record: a flight log read back as arrays."""

from __future__ import annotations

import json
import stat
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import orjson
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from drivers.flight_log.writer import EVENT, FORMAT, METADATA, TOPICS
from drivers.state import Command, Integers, State
from robots import Posture, Robot
from robots.quaternion import Array

PACK = 1024  # rows that are held as Python objects before they become an array
MOST_BYTES = 1 << 29  # of a file
MOST_UNPACKED = 1 << 30  # bytes of all its chunks: a flight of hours
RECORD_HEAD, CHUNK_HEAD = struct.Struct("<BQ"), struct.Struct("<QQQ")
KINDS = set(Opcode)
"""Kinds of records that there are."""
DAMAGE = (
    *(McapError, zstandard.ZstdError, struct.error, RuntimeError, EOFError, MemoryError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError),
)
"""Errors that reading a damaged log may raise; a RuntimeError is one of lz4."""


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
    """Content of a log, up to the first damaged chunk."""

    def __init__(self, data: bytes) -> None:
        """Read the whole records at the beginning of a file.

        Raises:
            ValueError: or another error of `DAMAGE`, if what it says of itself is damaged, if it
                unpacks to too much, or if its messages are not those of a flight.
        """
        end, self.is_complete, size = _survey(data)
        if size > MOST_UNPACKED:
            raise ValueError(f"it unpacks to {size} bytes, expected at most {MOST_UNPACKED}")
        self.damage = ""
        """What is wrong with the first damaged chunk; empty if nothing is."""
        self.about: dict[str, str] = {}
        self.events: list[Event] = []
        self._topic_of: dict[int, str] = {}
        self._topics: dict[str, _Columns] = {}
        self.lost_bytes = len(data) - self._read(data[:end])
        """Bytes at the end of the file that were not read."""

    def tracks(self) -> dict[str, Track]:
        """Return the tracks of all topics but the events."""
        return {topic: columns.track() for topic, columns in self._topics.items()}

    def _read(self, data: bytes) -> int:
        """Read whole records; return where the first damaged one begins, or the end."""
        stream, at = BytesIO(data), 0
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=None)
        records = reader.records
        while (record := self._next(records)) is not None:
            inside = self._open(record) if isinstance(record, Chunk) else [record]
            if self.damage:
                return at
            for one in inside:
                self._add(one)
            at = stream.tell()
        return at if self.damage else len(data)

    def _next(self, records: Iterator[McapRecord]) -> McapRecord | None:
        """Return the next record; None at the end of the data, or if the record is damaged."""
        try:
            record = next(records, None)
        except EndOfFile:  # a log that was cut off has no footer
            return None
        except CRCValidationError:  # of all data: something outside of the chunks is not as written
            raise
        except DAMAGE as error:
            self.damage = _explain(error)
            return None
        return None if isinstance(record, DataEnd) else record  # behind it there is an index only

    def _open(self, chunk: Chunk) -> list[McapRecord]:
        """Unpack a chunk; note if it is damaged."""
        try:
            plain = replace(chunk, compression="", data=_unpack(chunk))
            return breakup_chunk(plain, validate_crc=True)
        except DAMAGE as error:
            self.damage = _explain(error)
            return []

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


def _survey(data: bytes) -> tuple[int, bool, int]:
    """Find the end of the last whole record, whether a log ends there, and its unpacked size.

    A power cut can leave zeros where the file had grown but was not yet written: no record is of
    kind 0. The size is what the chunks say of themselves; none is unpacked beyond that.
    """
    at, size = len(MCAP0_MAGIC), 0
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        after = at + RECORD_HEAD.size + length
        if after > len(data) or opcode not in KINDS:
            break
        if opcode == Opcode.CHUNK and length >= CHUNK_HEAD.size:
            size += CHUNK_HEAD.unpack_from(data, at + RECORD_HEAD.size)[2]
        if opcode == Opcode.FOOTER and data.startswith(MCAP0_MAGIC, after):
            return after + len(MCAP0_MAGIC), True, size
        at = after
    return at, False, size


def _unpack(chunk: Chunk) -> bytes:
    """Unpack a chunk, to no more than the size that it says.

    Raises:
        ValueError: or another error of `DAMAGE`, if it has another size.
    """
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, size + 1)
    elif chunk.compression:
        raise ValueError(f"a chunk is packed by '{chunk.compression}', expected zstd or lz4")
    else:
        data = chunk.data
    if len(data) != size:
        raise ValueError(f"a chunk unpacks to {len(data)} bytes or more, expected {size}")
    return data


def _explain(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


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
    """Whether the log is incomplete, as after a kill, or damaged."""
    damage: str = ""
    """What is wrong with the first damaged chunk, which the record ends before; empty if none."""
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
        if not self.truncated:
            return summary
        how = f"damaged ({self.damage})" if self.damage else "cut off"
        return f"{summary}, {how}: {self.lost_bytes} bytes lost"

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> FlightRecord:
        """Load a flight log of a robot, or of any.

        Of one that was cut off or is damaged, all that comes before is read.

        Raises:
            ValueError: one line with the file and its problem: it is not a flight log, is
                damaged where it says whose it is, is too large, or another robot's.
        """
        try:
            data = _read_file(path)
        except OSError as error:
            raise ValueError(f"flight log {path}: {error.strerror or error}") from error
        except ValueError as error:
            raise ValueError(f"flight log {path}: {error}") from error
        try:
            record = _read(path, data)
        except DAMAGE as error:
            raise ValueError(f"flight log {path}: damaged ({_explain(error)})") from error
        if robot is not None:
            record.check_robot(robot)
        return record

    def check_robot(self, robot: Robot) -> None:
        """Refuse the log of another robot.

        Raises:
            ValueError: naming its robot.
        """
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


def _read_file(path: Path) -> bytes:
    """Read a file that begins like a log, and none whose end may never come."""
    found = path.stat()
    if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
        raise ValueError("not a regular file, expected a log of FlightLog")
    if found.st_size > MOST_BYTES:
        raise ValueError(f"it has {found.st_size} bytes, expected at most {MOST_BYTES}")
    data = path.read_bytes()
    if not data.startswith(MCAP0_MAGIC):
        raise ValueError("not an MCAP file, expected a log of FlightLog")
    return data


def _read(path: Path, data: bytes) -> FlightRecord:
    content = Content(data)
    about = content.about
    if not about:
        raise ValueError(content.damage or "it does not name its robot")
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
        truncated=not content.is_complete or bool(content.damage),
        damage=content.damage,
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
