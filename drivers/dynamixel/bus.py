"""A Dynamixel bus: questions out, answers in, and nobody's silence is an error."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel import protocol2
from drivers.dynamixel.port import Port
from drivers.dynamixel.protocol2 import HEADER, Damaged, FrameParser, Instruction, Span, Status

BITS_PER_BYTE = 10  # 8 data bits between a start and a stop bit
# Beyond the bytes' own time on the wire: the servo's turn-round, the USB adapter's latency
# (1 ms at its best, twice) and the host's scheduler.
ANSWER_MARGIN = 0.004  # s
FACTORY_RETURN_DELAY = 250 * 2e-6  # s (e-manual, Return Delay Time)
PING_DATA = 3  # bytes: model number, firmware
PING_SLOT = 0.003  # s that each of 253 ids has for its answer to a ping of all
TAIL_PATIENCE = 0.001  # s for the rest of an answer whose beginning cannot be found
_NAP_END = 200e-6  # s before an answer's end at which to be awake


@dataclass
class BusStatistics:
    """What has passed over a bus so far."""

    requests: int = 0
    """Instructions sent."""
    lost: int = 0
    """Answers that did not come."""
    damaged: int = 0
    """Answers whose CRC did not match."""
    stale: int = 0
    """Answers that belonged to another question."""
    retries: int = 0
    """Questions asked again."""
    bytes_out: int = 0
    bytes_in: int = 0

    def __sub__(self, earlier: BusStatistics) -> BusStatistics:
        """Return what has passed since an earlier look."""
        names = [item.name for item in fields(self)]
        return BusStatistics(**{n: getattr(self, n) - getattr(earlier, n) for n in names})


@dataclass(frozen=True)
class Request:
    """An instruction and the answers that it shall bring."""

    frame: bytes
    """The instruction, as it goes out."""
    lengths: Mapping[int, int]
    """Data bytes of each device's answer, in the order in which they answer."""
    is_fast: bool = False
    """Tell whether all answer in one frame."""

    @cached_property
    def answer_size(self) -> int:
        """Return the bytes of all answers when nothing needs stuffing."""
        data = sum(self.lengths.values())
        if self.is_fast:
            return protocol2.PREFIX + 1 + data + 4 * len(self.lengths)
        return data + (protocol2.OVERHEAD + 1) * len(self.lengths)

    @cached_property
    def places(self) -> dict[int, int]:
        """Return the place of each device in the order of the answers."""
        return {device: place for place, device in enumerate(self.lengths)}

    @cached_property
    def fast_frame(self) -> FastFrame:
        """Return what finds the one frame of a fast answer."""
        return FastFrame(self)

    @classmethod
    def group(cls, spans: Mapping[int, Span], *, fast: bool = False) -> Request:
        """Ask devices for registers: one alone, the same of all, or each for its own."""
        lengths = {device: span.length for device, span in spans.items()}
        different = set(spans.values())
        if len(different) > 1:
            return cls(protocol2.bulk_read(spans), lengths)
        span = different.pop()
        if len(spans) == 1 and not fast:
            return cls(protocol2.read(next(iter(spans)), span), lengths)
        return cls(protocol2.sync_read(list(spans), span, fast=fast), lengths, fast)


@dataclass(frozen=True, eq=False)
class Replies:
    """What a group told, in the order in which it was asked; who is silent is not in it."""

    devices: NDArray[np.uint8]
    """Ids, shape (k,)."""
    errors: NDArray[np.uint8]
    """Error bytes, shape (k,)."""
    data: NDArray[np.uint8]
    """Data bytes, shape (k, length)."""
    is_cut: bool = False
    """Tell whether the answer was damaged on its way, so that silence means nothing."""

    def column(self, offset: int, kind: str) -> NDArray[np.int_]:
        """Read a number out of everybody's data.

        Args:
            offset: Byte at which it begins.
            kind: Its type as numpy calls it, such as "<i4".
        """
        size = np.dtype(kind).itemsize
        return np.ascontiguousarray(self.data[:, offset : offset + size]).view(kind)[:, 0]

    def choose(self, rows: NDArray[np.bool_]) -> Replies:
        """Return some of them."""
        devices, errors, data = self.devices[rows], self.errors[rows], self.data[rows]
        return Replies(devices, errors, data, self.is_cut)

    @classmethod
    def of(cls, statuses: Sequence[Status], length: int, *, is_cut: bool = False) -> Replies:
        """Line up statuses that hold ``length`` bytes each; others are left out."""
        whole = [status for status in statuses if len(status.data) == length]
        data = np.frombuffer(b"".join([s.data for s in whole]), np.uint8)
        return cls(
            devices=np.array([s.id for s in whole], dtype=np.uint8),
            errors=np.array([s.error for s in whole], dtype=np.uint8),
            data=data.reshape(len(whole), length),
            is_cut=is_cut,
        )


@dataclass
class DynamixelBus:
    """Sends instructions over a port and finds the answers in what comes back.

    One question is open at a time. It has one deadline: the time that its bytes take on the
    wire and a margin; whoever has not answered by then is silent. What comes too late, in the
    wrong order or in the wrong length belongs to an earlier question and is dropped.
    Only a port that is gone raises (`PortLostError`).
    """

    port: Port
    answer_margin: float = ANSWER_MARGIN
    """Wait for an answer beyond its time on the wire [s]."""
    return_delay: float = FACTORY_RETURN_DELAY
    """Longest wait of a device before it answers [s]."""
    naps: bool = True
    """Sleep while the answer is on the wire, instead of taking it in byte by byte."""
    limit: float = np.inf
    """Time of the monotonic clock after which `put` waits for nobody [s]."""
    statistics: BusStatistics = field(default_factory=BusStatistics)
    _quiet_at: float = 0.0  # when the last byte sent has left the wire
    _deadline: float = 0.0  # of the open question

    @property
    def byte_time(self) -> float:
        """Return the time that a byte takes [s]."""
        return BITS_PER_BYTE / self.port.baud

    # Questions --------------------------------------------------------------------------------

    def duration(self, question: Request) -> float:
        """Compute how long a question and its answers are on the wire [s]."""
        delays = self.return_delay * (1 if question.is_fast else len(question.lengths))
        return (len(question.frame) + question.answer_size) * self.byte_time + delays

    def send(self, frame: bytes) -> None:
        """Send an instruction that nobody answers."""
        self.port.write(frame)
        self._note_sent(frame)

    def ask(self, question: Request) -> None:
        """Send a question; what came unasked before it is thrown away."""
        if self.port.flush():
            self.statistics.stale += 1
        self.port.write(question.frame)
        self._note_sent(question.frame)
        answering = self.duration(question) - len(question.frame) * self.byte_time
        self._deadline = self._quiet_at + answering + self.answer_margin

    def collect(self, question: Request, limit: float = np.inf) -> Iterator[Status]:
        """Take in the answers to the question that was asked last, one by one.

        Args:
            question: The one that was asked.
            limit: Time of the monotonic clock after which not to wait [s].
        """
        if question.is_fast:
            found, _ = self._take_fast(question, limit)
            statuses = found if isinstance(found, list) else _as_statuses(found)
        else:
            statuses = self._take_statuses(question, limit)
        yield from statuses

    def collect_group(self, question: Request, limit: float = np.inf) -> Replies:
        """Take in the answers of a group, of which each has the same length."""
        length = max(question.lengths.values())
        if not question.is_fast:
            damaged = self.statistics.damaged
            statuses = self._take_statuses(question, limit)
            return Replies.of(statuses, length, is_cut=self.statistics.damaged > damaged)
        found, is_cut = self._take_fast(question, limit)
        return found if isinstance(found, Replies) else Replies.of(found, length, is_cut=is_cut)

    def put(self, question: Request, tries: int = 1) -> dict[int, Status]:
        """Ask and take in the answers; ask again for those that are missing.

        Args:
            question: What to ask; more than one try needs a question to a single device.
            tries: How often to ask at most.
        """
        answers: dict[int, Status] = {}
        for attempt in range(tries):
            self.statistics.retries += attempt > 0
            self.ask(question)
            answers |= {status.id: status for status in self.collect(question, self.limit)}
            if len(answers) == len(question.lengths):
                if attempt:
                    self._drain()
                break
        return answers

    def _drain(self) -> None:
        """Wait until nothing comes any more: each try may bring its answer yet."""
        while self.port.read(time.monotonic() + self.answer_margin):
            self.statistics.stale += 1

    # One device -------------------------------------------------------------------------------

    def ping(self, device: int, tries: int = 1) -> Status | None:
        """Ask a device for its model and firmware; ``None`` when it is silent."""
        return self.put(Request(protocol2.ping(device), {device: PING_DATA}), tries).get(device)

    def read(self, device: int, span: Span, tries: int = 1) -> Status | None:
        """Read registers of a device; ``None`` when it is silent."""
        return self.put(Request.group({device: span}), tries).get(device)

    def write(self, device: int, address: int, data: bytes, tries: int = 1) -> Status | None:
        """Set registers of a device; ``None`` when it does not confirm."""
        frame = protocol2.write(device, address, data)
        return self.put(Request(frame, {device: 0}), tries).get(device)

    def reboot(self, device: int, tries: int = 1) -> Status | None:
        """Restart a device; ``None`` when it does not confirm."""
        return self.put(Request(protocol2.reboot(device), {device: 0}), tries).get(device)

    # All devices ------------------------------------------------------------------------------

    def find(self) -> dict[int, Status]:
        """Ping all ids at once; return who answers, after the second that this takes."""
        self.port.flush()
        self.send(protocol2.ping())
        slot = PING_SLOT + (protocol2.OVERHEAD + 1 + PING_DATA) * self.byte_time
        limit = self._quiet_at + (protocol2.MAX_ID + 1) * slot + self.answer_margin
        parser, found = FrameParser(), {}
        while chunk := self.port.read(limit):
            self.statistics.bytes_in += len(chunk)
            for status in self._statuses(parser, chunk):
                if len(status.data) == PING_DATA:
                    found[status.id] = status
        return found

    # Bytes ------------------------------------------------------------------------------------

    def _note_sent(self, frame: bytes) -> None:
        self.statistics.requests += 1
        self.statistics.bytes_out += len(frame)
        begin = max(time.monotonic(), self._quiet_at)
        self._quiet_at = begin + len(frame) * self.byte_time

    def _nap(self, limit: float) -> None:
        """Sleep until just before the answers can be complete."""
        if self.naps:
            answered = min(self._deadline - self.answer_margin, limit)
            left = answered - _NAP_END - time.monotonic()
            if left > _NAP_END:
                time.sleep(left)

    def _take_statuses(self, question: Request, limit: float) -> list[Status]:
        limit = min(limit, self._deadline)
        order = question.places
        parser, found = FrameParser(), list[tuple[int, Status]]()
        if len(order) > 1:
            self._nap(limit)
        while not (found and found[-1][0] == len(order) - 1):
            chunk = self.port.read(limit)
            if not chunk:
                break
            self.statistics.bytes_in += len(chunk)
            for status in self._statuses(parser, chunk):
                place = order.get(status.id)
                if place is None or not _fits(status, question.lengths[status.id]):
                    self.statistics.stale += 1
                    continue
                # Devices answer in order, and once: who is overtaken was a late answer.
                while found and found[-1][0] >= place:
                    self.statistics.stale += 1
                    found.pop()
                found.append((place, status))
        self.statistics.lost += len(order) - len(found)
        return [status for _, status in found]

    def _statuses(self, parser: FrameParser, chunk: bytes) -> Iterator[Status]:
        for item in parser.feed(chunk):
            if isinstance(item, Damaged):
                self.statistics.damaged += 1
            elif item.instruction == Instruction.STATUS and item.params:
                yield Status(item.id, item.params[0], item.params[1:])

    def _take_fast(self, question: Request, limit: float) -> tuple[Replies | list[Status], bool]:
        """Take in one frame of all; tell also whether it was damaged."""
        limit = min(limit, self._deadline)
        frame = question.fast_frame
        frame.stale = 0
        buffer = b""
        self._nap(limit)
        while chunk := self.port.read(limit):
            self.statistics.bytes_in += len(chunk)
            buffer += chunk
            if len(buffer) < frame.size:
                continue
            whole = frame.decode(buffer)
            if whole is not None:
                self.statistics.stale += frame.stale
                return whole, False
            limit = min(limit, time.monotonic() + TAIL_PATIENCE)
        statuses = frame.salvage(buffer)
        is_cut = len(buffer) >= frame.size and len(statuses) < len(question.lengths)
        self.statistics.stale += frame.stale
        self.statistics.damaged += is_cut
        self.statistics.lost += len(question.lengths) - len(statuses)
        return statuses, is_cut


class FastFrame:
    """Finds the one frame that answers a fast read in what came over the wire."""

    def __init__(self, question: Request) -> None:
        self.size = question.answer_size
        """Bytes of the whole frame."""
        self.stale = 0
        """Frames seen that answer another question."""
        self._order = bytes(question.lengths)
        self._lengths = list(question.lengths.values())
        body = self.size - protocol2.PREFIX
        self._start = HEADER + bytes((protocol2.BROADCAST, body & 0xFF, body >> 8, 0x55))
        self._rows = np.dtype(
            [("error", "u1"), ("id", "u1"), ("data", "u1", self._lengths[0]), ("crc", "<u2")]
        )

    def decode(self, buffer: bytes) -> Replies | None:
        """Read the frame if it is there, whole and of the right devices."""
        self.stale = 0
        for start in self._find_starts(buffer):
            frame = buffer[start : start + self.size]
            if len(frame) < self.size:
                return None
            if protocol2.crc16(frame[:-2]) != frame[-2] | frame[-1] << 8:
                continue
            rows = np.frombuffer(frame, self._rows, offset=len(self._start))
            if rows["id"].tobytes() != self._order:
                self.stale += 1
                continue
            return Replies(rows["id"], rows["error"], rows["data"])
        return None

    def salvage(self, buffer: bytes) -> list[Status]:
        """Read what is sound of a damaged frame: the answers up to the first that is not.

        Those of silent devices may be missing in between.
        """
        best: list[Status] = []
        for start in self._find_starts(buffer):
            told = protocol2.decode_fast_status(buffer[start : start + self.size], self._lengths)
            places = [self._order.find(status.id) for status in told]
            if places == sorted(set(places)) and -1 not in places:
                best = max(best, told, key=len)
        return best

    def _find_starts(self, buffer: bytes) -> Iterator[int]:
        start = buffer.find(self._start)
        while start >= 0:
            yield start
            start = buffer.find(self._start, start + 1)


class SyncWriter:
    """Builds sync writes of one item, again and again, from arrays.

    The rows are filled in place; only the CRC is computed anew.
    """

    def __init__(self, address: int, kind: str, devices: Sequence[int]) -> None:
        """Prepare a writer.

        Args:
            address: Register of the item.
            kind: The item's type as numpy calls it, such as "<i4".
            devices: Ids, in the order of the values to come.
        """
        self._address = address
        self._rows = np.zeros(len(devices), np.dtype([("id", "u1"), ("value", kind)]))
        self._rows["id"] = devices
        size = np.dtype(kind).itemsize
        self._head = protocol2.sync_write(address, {0: bytes(size)})[:12]
        length = len(self._rows.tobytes()) + 7
        self._head = self._head[:5] + length.to_bytes(2, "little") + self._head[7:]

    def encode(self, values: NDArray[np.int_]) -> bytes:
        """Build the frame that sets everybody's value."""
        self._rows["value"] = values
        body = self._rows.tobytes()
        if b"\xff\xff\xfd" in body:
            rows = {int(row["id"]): row["value"].tobytes() for row in self._rows}
            return protocol2.sync_write(self._address, rows)
        return protocol2.seal(self._head + body)

    def encode_some(self, chosen: NDArray[np.bool_], values: NDArray[np.int_]) -> bytes:
        """Build the frame that sets the value of some."""
        self._rows["value"] = values
        rows = self._rows[chosen]
        return protocol2.sync_write(
            self._address, {int(row["id"]): row["value"].tobytes() for row in rows}
        )


def _as_statuses(answers: Replies) -> list[Status]:
    rows = zip(answers.devices, answers.errors, answers.data, strict=True)
    return [Status(int(device), int(error), data.tobytes()) for device, error, data in rows]


def _fits(status: Status, length: int) -> bool:
    """Tell whether a status may answer a question; one that refuses holds no data."""
    return len(status.data) == length or bool(status.number and not status.data)
