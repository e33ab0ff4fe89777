"""Sends requests over a Dynamixel bus and collects replies; a missing reply is not an error."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields

import numpy as np

from drivers.dynamixel import protocol2
from drivers.dynamixel.control_table import Item
from drivers.dynamixel.protocol2 import (
    Damaged,
    FrameParser,
    Instruction,
    Packet,
    Reset,
    Span,
    Status,
    is_confirmed,
)
from drivers.dynamixel.requests import Replies, Request
from drivers.dynamixel.wire import FIRST, PING_DATA, PROTOCOL_2, Wire, decode_identity
from drivers.serial_port import CHUNK, SerialPort

BITS_PER_BYTE = 10  # 8 data bits between a start and a stop bit
# Beyond the bytes' own time on the wire: the servo's turnaround, the USB adapter's latency
# (1 ms at its best, twice) and the host's scheduler.
ANSWER_MARGIN = 0.004  # s
LOCK_STEP_MARGIN = 0.2  # s; where time is simulated nothing is timed, and the machine may be busy
FACTORY_RETURN_DELAY = 250 * 2e-6  # s (e-manual, Return Delay Time)
TRIES = 3  # of a request outside the control cycle
PING_SLOT = 0.003  # s that each of 253 ids has for its reply to a broadcast ping
TAIL_TIMEOUT = 0.001  # s for the rest of a fast reply whose beginning is missing
LONGEST_NOISE = 1.0  # s for which to wait until a line is silent
WAKE_EARLY = 200e-6  # s before the end of a reply at which to be awake


@dataclass
class BusStatistics:
    """Traffic of a bus so far."""

    requests: int = 0
    """Instructions sent."""
    lost: int = 0
    """Replies that did not come."""
    damaged: int = 0
    """Replies whose CRC did not match."""
    stale: int = 0
    """Replies to another request."""
    retries: int = 0
    """Requests repeated."""
    bytes_out: int = 0
    bytes_in: int = 0

    def __sub__(self, earlier: BusStatistics) -> BusStatistics:
        """Return the traffic since an earlier count."""
        names = [item.name for item in fields(self)]
        return BusStatistics(**{n: getattr(self, n) - getattr(earlier, n) for n in names})


@dataclass
class DynamixelBus:
    """Sends instructions over a port and finds the replies in what comes back.

    One request is open at a time. Its deadline is the time of its bytes on the wire plus a
    margin; devices that have not replied by then are silent. Replies that are late, out of
    order or of the wrong length belong to an earlier request and are dropped.
    Only a lost port raises (`PortLostError`).
    """

    port: SerialPort
    answer_margin: float = ANSWER_MARGIN
    """Wait for a reply beyond its time on the wire [s]."""
    sleeps: bool = True
    """Sleep while a reply is on the wire, instead of reading it byte by byte."""
    statistics: BusStatistics = field(default_factory=BusStatistics)
    return_delay: float = FACTORY_RETURN_DELAY
    """Longest wait of a device before it replies [s]."""
    wire: Wire = PROTOCOL_2
    """Protocol that the devices speak."""
    instructions: Collection[int] | None = None
    """Instructions that all of them know; None for those of the protocol."""
    searched: tuple[Wire, ...] = (PROTOCOL_2,)
    """Protocols in which devices are searched for, where it is not known which they speak."""
    unsent: set[int] = field(default_factory=set)
    """Ids that the last request had no time to read: not sent, or cut off by a cycle's limit
    before the reply was late."""
    repeated: set[int] = field(default_factory=set)
    """Ids that replied more than once to the last ping of all."""
    _limit: float = np.inf  # time of the monotonic clock after which `request` does not wait
    _quiet_at: float = 0.0  # when the last byte sent has left the wire
    _deadline: float = 0.0  # of the open request

    @property
    def byte_time(self) -> float:
        """Return the time that a byte takes [s]."""
        return BITS_PER_BYTE / self.port.baud

    @contextmanager
    def until(self, limit: float) -> Iterator[None]:
        """Let `request` wait no longer than a time of the monotonic clock [s] inside the block."""
        self._limit = limit
        try:
            yield
        finally:
            self._limit = np.inf

    # Requests ---------------------------------------------------------------------------------

    def duration(self, request: Request) -> float:
        """Compute how long a request and its replies are on the wire [s]."""
        delays = self.return_delay * (1 if request.is_fast else len(request.lengths))
        return (request.size + request.reply_size) * self.byte_time + delays

    def send(self, frame: bytes) -> None:
        """Send an instruction that has no reply."""
        self.port.write(frame)
        self.statistics.requests += 1
        self.statistics.bytes_out += len(frame)
        begin = max(time.monotonic(), self._quiet_at)
        self._quiet_at = begin + len(frame) * self.byte_time

    def group(self, spans: Mapping[int, Span], *, fast: bool = False) -> Request:
        """Build the request that reads registers of several devices; see `Request.group`."""
        return Request.group(spans, fast=fast, wire=self.wire, instructions=self.instructions)

    def ask(self, packet: Packet, length: int = 0) -> Request:
        """Build the request of an instruction whose reply has some bytes of data."""
        return Request(self.wire.encode(packet), {packet.id: length}, overhead=self.wire.overhead)

    def begin(self, request: Request) -> None:
        """Send a request, or its first part; bytes that came before it are dropped."""
        request = request.first
        if self.port.flush():
            self.statistics.stale += 1
        self.send(request.frame)
        replying = self.duration(request) - len(request.frame) * self.byte_time
        self._deadline = self._quiet_at + replying + self.answer_margin

    def collect(self, request: Request, limit: float = np.inf) -> list[Status]:
        """Collect the replies to the open request, which is not a fast one.

        ``limit`` is a time of the monotonic clock after which not to wait [s]. Parts of the
        request that are still to be sent are sent, while there is time.
        """
        self.unsent = set()
        found = self._collect_one(request.first, limit)
        for part in request.parts[1:]:
            if time.monotonic() + self.duration(part) > limit:
                self.unsent.update(part.lengths)
                continue
            self.begin(part)
            found += self._collect_one(part, limit)
        return found

    def _collect_one(self, request: Request, limit: float) -> list[Status]:
        is_cut_off = limit < self._deadline
        limit = min(limit, self._deadline)
        order = request.places
        parser, found = self.wire.parse_replies(), list[tuple[int, Status]]()
        if len(order) > 1:
            self._sleep(limit)
        while not (found and found[-1][0] == len(order) - 1):
            chunk = self.port.read(limit)
            if not chunk:
                break
            for status in self._parse(parser, chunk):
                place = order.get(status.id)
                if place is None or not _fits(status, request.lengths[status.id]):
                    self.statistics.stale += 1
                    continue
                # Devices reply in order, and once: a reply that is overtaken was a late one.
                while found and found[-1][0] >= place:
                    self.statistics.stale += 1
                    found.pop()
                found.append((place, status))
        if is_cut_off:
            self.unsent.update(order.keys() - {status.id for _, status in found})
        self.statistics.lost += len(order) - len(found)
        return [status for _, status in found]

    def collect_group(self, request: Request, limit: float = np.inf) -> Replies:
        """Collect the replies of a group, all of the same length."""
        if request.is_fast:
            return self._collect_fast(request, limit)
        damaged = self.statistics.damaged
        statuses = self.collect(request, limit)
        is_damaged = self.statistics.damaged > damaged
        return Replies.of(statuses, max(request.lengths.values()), is_damaged=is_damaged)

    def request(self, request: Request, tries: int = 1) -> dict[int, Status]:
        """Send a request and collect the replies, by id; more tries are for a single device."""
        replies: dict[int, Status] = {}
        for attempt in range(tries):
            self.statistics.retries += attempt > 0
            self.begin(request)
            replies |= {status.id: status for status in self.collect(request, self._limit)}
            if len(replies) == len(request.lengths):
                # Each earlier try may still be answered.
                while attempt and self.port.read(time.monotonic() + self.answer_margin):
                    self.statistics.stale += 1
                break
        return replies

    # One device -------------------------------------------------------------------------------

    def ping(self, device: int, tries: int = 1) -> Status | None:
        """Read the model and firmware of a device; ``None`` if it is silent."""
        status = self.request(self.ask_identity(device), tries).get(device)
        return None if status is None else decode_identity(self.wire, status)

    def ask_identity(self, device: int) -> Request:
        """Build the request that reads the model and firmware of a device."""
        if self.wire is PROTOCOL_2:
            return self.ask(protocol2.ping(device), PING_DATA)
        return self.ask(protocol2.read(device, FIRST), FIRST.length)

    def hears(self, device: int) -> bool:
        """Return whether a device replies to a ping, as one does that replies to nothing else."""
        length = PING_DATA if self.wire is PROTOCOL_2 else 0
        return device in self.request(self.ask(protocol2.ping(device), length))

    def read(self, device: int, span: Span, tries: int = 1) -> Status | None:
        """Read registers of a device; ``None`` if it is silent."""
        return self.request(self.group({device: span}), tries).get(device)

    def write(self, device: int, address: int, data: bytes, tries: int = 1) -> Status | None:
        """Write registers of a device; ``None`` if it does not confirm."""
        return self.request(self.ask(protocol2.write(device, address, data)), tries).get(device)

    def read_item(self, device: int, item: Item, tries: int = TRIES) -> int | None:
        """Read an item of a device; ``None`` if it is silent or refuses."""
        status = self.read(device, item.span, tries)
        return item.decode(status.data) if is_confirmed(status) else None

    def write_item(self, device: int, item: Item, value: int, tries: int = TRIES) -> bool:
        """Write an item of a device; return whether it confirms."""
        return is_confirmed(self.write(device, item.address, item.encode(value), tries))

    def reboot(self, device: int, tries: int = 1) -> Status | None:
        """Restart a device; ``None`` if it does not confirm."""
        return self.request(self.ask(protocol2.reboot(device)), tries).get(device)

    def factory_reset(self, device: int, kept: Reset) -> Status | None:
        """Set a device's EEPROM to its defaults; ``None`` if it does not confirm."""
        return self.request(self.ask(protocol2.factory_reset(device, kept))).get(device)

    # All devices ------------------------------------------------------------------------------

    def ping_all(self) -> dict[int, Status]:
        """Ping all ids of Protocol 2.0 at once; return the replies after the 0.8 s of their slots.

        Each id replies in its own slot: until the end of the last one, more may come.
        """
        self.repeated = set()
        self.port.flush()
        self.send(PROTOCOL_2.encode(protocol2.ping()))
        slot = PING_SLOT + (PROTOCOL_2.overhead + PING_DATA) * self.byte_time
        limit = self._quiet_at + (protocol2.MAX_ID + 1) * slot + self.answer_margin
        parser, found = PROTOCOL_2.parse_replies(), {}
        while chunk := self.port.read(limit):
            for status in self._parse(parser, chunk):
                if len(status.data) == PING_DATA:
                    self.repeated |= {status.id} & found.keys()
                    found[status.id] = status
        return found

    # Bytes ------------------------------------------------------------------------------------

    def await_silence(self) -> None:
        """Drop what comes until nothing has come for the answer margin, or the line never rests."""
        until = time.monotonic() + LONGEST_NOISE
        while (now := time.monotonic()) < until:
            if not (chunk := self.port.read(now + self.answer_margin)):
                return
            self.statistics.bytes_in += len(chunk)
            self.statistics.stale += 1

    def listen(self, request: Request) -> Iterator[bytes]:
        """Send a request to one device; yield all that has come so far, until its deadline."""
        self.begin(request)
        heard = b""
        while len(heard) < CHUNK and (chunk := self.port.read(self._deadline)):
            self.statistics.bytes_in += len(chunk)
            heard += chunk
            yield heard

    def _sleep(self, limit: float) -> None:
        """Sleep until just before the replies can be complete."""
        if self.sleeps:
            complete = min(self._deadline - self.answer_margin, limit)
            left = complete - WAKE_EARLY - time.monotonic()
            if left > WAKE_EARLY:
                time.sleep(left)

    def _parse(self, parser: FrameParser, chunk: bytes) -> Iterator[Status]:
        self.statistics.bytes_in += len(chunk)
        for item in parser.feed(chunk):
            if isinstance(item, Damaged):
                self.statistics.damaged += 1
            elif item.instruction == Instruction.STATUS and item.params:
                yield self.wire.decode_status(item)

    def _collect_fast(self, request: Request, limit: float) -> Replies:
        limit = min(limit, self._deadline)
        frame = request.fast_frame
        frame.stale = 0
        buffer = b""
        self._sleep(limit)
        while chunk := self.port.read(limit):
            self.statistics.bytes_in += len(chunk)
            buffer += chunk
            if len(buffer) < frame.size:
                continue
            whole = frame.decode(buffer)
            if whole is not None:
                self.statistics.stale += frame.stale
                return whole
            limit = min(limit, time.monotonic() + TAIL_TIMEOUT)
        statuses = frame.salvage(buffer)
        is_damaged = len(buffer) >= frame.size and len(statuses) < len(request.lengths)
        self.statistics.stale += frame.stale
        self.statistics.damaged += is_damaged
        self.statistics.lost += len(request.lengths) - len(statuses)
        return Replies.of(statuses, max(request.lengths.values()), is_damaged=is_damaged)


def _fits(status: Status, length: int) -> bool:
    """Return whether a status may answer a request; one that refuses holds no data."""
    return len(status.data) == length or bool(status.number and not status.data)
