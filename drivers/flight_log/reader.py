"""The flight record: a flight log read back as arrays."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
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
UNFILLED = bytes(64)  # no record ends so


@dataclass(frozen=True)
class Event:
    """Something that happened in a flight."""

    time: float
    """When, on the backend's clock [s]."""
    kind: str
    """One word: "fault", "alert", "phase"..."""
    text: str
    cycle: int
    """The first cycle that was logged after it."""


@dataclass(frozen=True)
class Track:
    """One part of a flight's cycles, a column for each of its fields."""

    cycle: Integers
    """The cycles that have the part, shape (T,)."""
    columns: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a field of all cycles, shape (T, ...)."""
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns


class Content:
    """What a log holds."""

    def __init__(self, data: bytes) -> None:
        """Read the whole records at the beginning of a file.

        Raises:
            ValueError: or another error of the decoders, if the data is damaged.
        """
        # A power cut can leave zeros, where the file had grown and was not yet filled.
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
        """Return what each topic but the events' holds."""
        return {topic: columns.track() for topic, columns in self._topics.items()}

    def _add(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            topic, message = self._topic_of[record.channel_id], orjson.loads(record.data)
            if topic == EVENT:
                self.events.append(Event(**message, cycle=record.sequence))
            else:
                self._topics.setdefault(topic, _Columns()).add(record.sequence, message)
        elif isinstance(record, Channel):
            self._topic_of[record.id] = record.topic
        elif isinstance(record, Metadata) and record.name == METADATA:
            self.about = record.metadata


def _find_end(data: bytes) -> tuple[int, bool]:
    """Find where the last whole record ends, and tell whether that is the end of a log."""
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
    """Read records; a chunk or a finished log that does not match its checksum raises."""
    stream = BytesIO(data)
    try:
        yield from StreamReader(stream, validate_crcs=True, record_size_limit=None).records
    except EndOfFile:  # a log that was cut off has no footer
        if stream.tell() < len(data):
            raise


@dataclass
class _Columns:
    """The messages of a topic on their way to columns."""

    cycles: list[int] = field(default_factory=list)
    rows: dict[str, list[Any]] = field(default_factory=dict)
    packs: dict[str, list[np.ndarray]] = field(default_factory=dict)

    def add(self, cycle: int, message: dict[str, Any]) -> None:
        if not self.cycles:
            self.rows = {name: [] for name in message}
            self.packs = {name: [] for name in message}
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
    """Stack JSON values; null among numbers is NaN, what has no common shape stays a list."""
    try:
        stacked = np.array(rows)
        return stacked.astype(float) if stacked.dtype == object else stacked
    except (ValueError, TypeError):
        return np.fromiter(rows, dtype=object, count=len(rows))


def _join(packs: list[np.ndarray]) -> np.ndarray:
    try:
        return np.concatenate(packs)
    except ValueError:  # a command of another length between sound ones
        return np.fromiter((row for pack in packs for row in pack), dtype=object)


DAMAGE = (
    *(McapError, zstandard.ZstdError, struct.error, MemoryError, RecursionError),
    *(ValueError, TypeError, KeyError, IndexError, OverflowError),
)
"""What reading a damaged log may raise."""
NEEDED = ("state", "asked", "sent")


__all__ = ["Event", "FlightRecord", "Track"]


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
    """Where the robot was at the first cycle, at rest."""
    tracks: Mapping[str, Track]
    """The parts of a cycle by the names of `Cycle`'s fields; none before the first cycle."""
    events: tuple[Event, ...]
    truncated: bool
    """Whether the log ends before its end, as one does whose program was killed."""
    lost_bytes: int
    """Bytes at the end of a truncated log that could not be read."""

    @property
    def cycles(self) -> int:
        """Return how many cycles could be read."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """Return when each cycle was measured, on the backend's clock [s], shape (T,)."""
        return self.tracks["state"]["time"] if self.tracks else np.zeros(0)

    @property
    def state(self) -> Track:
        """Return what was measured."""
        return self.tracks["state"]

    @property
    def asked(self) -> Track:
        """Return what the controller wanted."""
        return self.tracks["asked"]

    @property
    def sent(self) -> Track:
        """Return what reached the servos."""
        return self.tracks["sent"]

    def measurement(self, cycle: int) -> State:
        """Return what was measured in a cycle."""
        return State(**_row(self.state, State, cycle))

    def command(self, cycle: int) -> Command:
        """Return what reached the servos in a cycle."""
        # Logs older than this limit do not hold it: all of the supply was allowed.
        unlimited = {"pwm_limit": np.ones(len(self.joint_names))}
        return Command(**unlimited | _row(self.sent, Command, cycle))

    def describe(self) -> str:
        """Tell in one line how much there is."""
        seconds = float(self.time[-1] - self.time[0]) if self.cycles else 0.0
        told = f"{self.robot}: {self.cycles} cycles, {seconds:.2f} s, {len(self.events)} events"
        return f"{told}, cut off ({self.lost_bytes} bytes lost)" if self.truncated else told

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> FlightRecord:
        """Load a flight log, or of one that was cut off all that is whole.

        Args:
            path: File that `FlightLog` wrote.
            robot: Robot that it must be of; ``None`` for any.

        Raises:
            ValueError: one line that names the file and its fault: it is no flight log, is
                damaged, or another robot's.
        """
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ValueError(f"flight log {path}: {error.strerror or error}") from error
        if not data.startswith(MCAP0_MAGIC):
            raise ValueError(f"flight log {path}: not an MCAP file, allowed a log of FlightLog")
        try:
            record = _read(path, data)
        except DAMAGE as error:
            fault = " ".join(str(error).split())[:200] or type(error).__name__
            raise ValueError(f"flight log {path}: damaged ({fault})") from error
        if robot is not None:
            record.check_robot(robot)
        return record

    def check_robot(self, robot: Robot) -> None:
        """Refuse another robot.

        Raises:
            ValueError: saying whose log it is.
        """
        if self.robot != robot.name:
            fault = f"of robot '{self.robot}', allowed '{robot.name}'"
        elif self.joint_names != robot.joint_names:
            fault = (
                f"of a '{robot.name}' with joints {', '.join(self.joint_names)}, "
                f"allowed {', '.join(robot.joint_names)}"
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
        raise ValueError("it does not say which robot it is of")
    if about["format"] != FORMAT:
        raise ValueError(f"format is '{about['format']}', allowed '{FORMAT}'")
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
    """Check that each cycle was measured, asked and sent, n joints each."""
    cycles = tracks["state"].cycle
    for name in NEEDED:
        if not np.array_equal(tracks[name].cycle, cycles):
            raise ValueError(f"not every cycle has its '{name}'")
    for name in ("state", "sent"):
        shape = tracks[name]["joint_pos"].shape
        if shape != (len(cycles), n):
            raise ValueError(f"{name} has angles of shape {shape}, allowed {(len(cycles), n)}")


def _parse_posture(text: str, joint_names: tuple[str, ...]) -> Posture | None:
    if not text:
        return None
    record = json.loads(text)
    angles = [record["joint_pos"][name] for name in joint_names]
    return Posture(
        position=np.array(record["position"], dtype=float),
        orientation=np.array(record["orientation"], dtype=float),
        joint_pos=np.array(angles, dtype=float),
    )
