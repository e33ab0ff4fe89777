"""Content of a flight log: its intact records as columns."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
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

from drivers.flight_log.foxglove import SCHEMAS
from drivers.flight_log.writer import EVENT, METADATA
from drivers.state import Integers

PACK = 1024  # rows that are held as Python objects before they become an array
MOST_UNPACKED = 1 << 31  # bytes of all its chunks: a flight of an hour
RECORD_HEAD, CHUNK_HEAD = struct.Struct("<BQ"), struct.Struct("<QQQ")
KINDS = set(Opcode)
"""All kinds of records."""
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
    log_time: Integers
    """Wall times [ns since 1970], shape (T,); in old logs the backend's clock [ns]."""
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
        """Problem of the first damaged chunk; empty if there is none."""
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
            self.damage = explain(error)
            return None
        return None if isinstance(record, DataEnd) else record  # behind it there is an index only

    def _open(self, chunk: Chunk) -> list[McapRecord]:
        """Unpack a chunk; note if it is damaged."""
        try:
            plain = replace(chunk, compression="", data=_unpack(chunk))
            return breakup_chunk(plain, validate_crc=True)
        except DAMAGE as error:
            self.damage = explain(error)
            return []

    def _add(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            self._add_message(record, self._topic_of[record.channel_id])
        elif isinstance(record, Channel):
            self._topic_of[record.id] = record.topic
        elif isinstance(record, Metadata) and record.name == METADATA:
            self.about = record.metadata

    def _add_message(self, record: Message, topic: str) -> None:
        if topic in SCHEMAS:  # the same values for other programs
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
    """Unpack a chunk, up to the size that it states.

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
