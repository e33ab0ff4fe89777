"""Content of a flight log: its intact records as columns."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
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
from drivers.flight_log.writer import EVENT, METADATA
from drivers.state import Integers

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
