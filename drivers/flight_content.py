"""What a flight log's file holds, gathered record by record; cut off or damaged, too."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np
import orjson
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from drivers.flight_log import EVENT, METADATA
from drivers.state import Integers

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
