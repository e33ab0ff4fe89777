"""Requests to devices and their replies, as arrays where a group answers."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel import protocol2
from drivers.dynamixel.control_table import ControlTable, Item
from drivers.dynamixel.protocol2 import HEADER, STUFFED, Instruction, Span, Status
from drivers.dynamixel.wire import PROTOCOL_2, Wire


@dataclass(frozen=True)
class Request:
    """An instruction and the replies that it expects."""

    frame: bytes
    """The instruction, as sent."""
    lengths: Mapping[int, int]
    """Data bytes of each device's reply, in the order of the replies."""
    is_fast: bool = False
    """Whether all devices reply in one frame."""
    overhead: int = PROTOCOL_2.overhead
    """Bytes of a reply around its data."""
    parts: tuple[Request, ...] = ()
    """Requests to send one after the other instead, each when the one before is answered: what
    reads a group where there is no instruction for it."""

    @cached_property
    def first(self) -> Request:
        """Return what is sent at once: the request, or its first part."""
        return self.parts[0] if self.parts else self

    @cached_property
    def reply_size(self) -> int:
        """Return the bytes of all replies if nothing needs stuffing."""
        data = sum(self.lengths.values())
        if self.is_fast:
            return protocol2.PREFIX + 1 + data + 4 * len(self.lengths)
        return data + self.overhead * len(self.lengths)

    @cached_property
    def places(self) -> dict[int, int]:
        """Return the place of each device in the order of the replies."""
        return {device: place for place, device in enumerate(self.lengths)}

    @cached_property
    def fast_frame(self) -> FastFrame:
        """Return the decoder of a fast reply."""
        return FastFrame(self)

    @cached_property
    def size(self) -> int:
        """Return the bytes of the instruction, or of all parts."""
        return sum(len(part.frame) for part in self.parts) or len(self.frame)

    @classmethod
    def group(
        cls,
        spans: Mapping[int, Span],
        *,
        fast: bool = False,
        wire: Wire = PROTOCOL_2,
        instructions: Collection[int] | None = None,
    ) -> Request:
        """Read registers of several devices: by read, sync read or bulk read, or one by one.

        ``instructions`` are those that the devices know; None for those of the protocol.
        """
        known = wire.instructions if instructions is None else instructions
        lengths = {device: span.length for device, span in spans.items()}
        different = set(spans.values())
        if len(spans) == 1 and not fast:
            packet = protocol2.read(*next(iter(spans.items())))
        elif len(different) == 1 and Instruction.SYNC_READ in known:
            packet = protocol2.sync_read(list(spans), different.pop(), fast=fast)
        elif Instruction.BULK_READ in known:
            packet = protocol2.bulk_read(spans)
        else:
            alone = [
                cls(wire.encode(protocol2.read(i, span)), {i: span.length}, overhead=wire.overhead)
                for i, span in spans.items()
            ]
            return cls(b"", lengths, overhead=wire.overhead, parts=tuple(alone))
        return cls(wire.encode(packet), lengths, fast, wire.overhead)


@dataclass(frozen=True, eq=False)
class Replies:
    """Replies of a group, in the order of the request; silent devices are left out."""

    devices: NDArray[np.uint8]
    """Ids, shape (k,)."""
    errors: NDArray[np.uint8]
    """Error bytes, shape (k,)."""
    data: NDArray[np.uint8]
    """Data bytes, shape (k, length)."""
    is_damaged: bool = False
    """Whether something was damaged on the wire, so that silence does not mean a fault."""

    def column(self, offset: int, kind: str) -> NDArray[np.int_]:
        """Decode a number of every reply, by its first byte and numpy type, such as "<i4"."""
        size = np.dtype(kind).itemsize
        return np.ascontiguousarray(self.data[:, offset : offset + size]).view(kind)[:, 0]

    def select(self, rows: NDArray[np.bool_]) -> Replies:
        """Return some of the replies."""
        return Replies(self.devices[rows], self.errors[rows], self.data[rows], self.is_damaged)

    def join(self, later: Replies) -> Replies:
        """Append the replies to a later request, all cut to the shorter data."""
        length = min(self.data.shape[1], later.data.shape[1])
        return Replies(
            np.concatenate([self.devices, later.devices]),
            np.concatenate([self.errors, later.errors]),
            np.concatenate([self.data[:, :length], later.data[:, :length]]),
            later.is_damaged,
        )

    @classmethod
    def of(cls, statuses: Sequence[Status], length: int, *, is_damaged: bool = False) -> Replies:
        """Stack statuses that hold ``length`` bytes each; others are left out."""
        whole = [status for status in statuses if len(status.data) == length]
        data = np.frombuffer(b"".join([s.data for s in whole]), np.uint8)
        return cls(
            devices=np.array([s.id for s in whole], dtype=np.uint8),
            errors=np.array([s.error for s in whole], dtype=np.uint8),
            data=data.reshape(len(whole), length),
            is_damaged=is_damaged,
        )


@dataclass(frozen=True)
class GroupLayout:
    """Adjacent registers of a servo that one read covers."""

    load: Item
    """Its current, or a share of its torque."""
    velocity: Item
    position: Item

    @classmethod
    def of(cls, table: ControlTable) -> GroupLayout:
        """Find them in a control table: with the load where it has one, else the current."""
        velocity, position = table["present_velocity"], table["present_position"]
        load = table["present_load"] if "present_load" in table else table["present_current"]
        return cls(load, velocity, position)

    @property
    def measures_current(self) -> bool:
        """Return whether its load is a current, not a share from which one is estimated."""
        return self.load.name == "present_current"

    @cached_property
    def span(self) -> Span:
        """Return the registers from the first of them to the last."""
        items = (self.load, self.velocity, self.position)
        start = min(item.address for item in items)
        return Span(start, max(item.end for item in items) - start)

    def decode(self, item: Item, replies: Replies) -> NDArray[np.int_]:
        """Decode one of them in every reply, (k,)."""
        column = replies.column(item.address - self.span.address, item.kind)
        if item.sign_bit is None:
            return column
        amount = column.astype(int) & ((1 << item.sign_bit) - 1)
        return np.where(column >> item.sign_bit & 1, -amount, amount)


class FastFrame:
    """Finds and decodes the frame that answers a fast read."""

    def __init__(self, request: Request) -> None:
        self.size = request.reply_size
        """Bytes of the whole frame."""
        self.stale = 0
        """Frames seen that answer another request."""
        self._order = bytes(request.lengths)
        self._lengths = list(request.lengths.values())
        body = (self.size - protocol2.PREFIX).to_bytes(2, "little")
        start = HEADER + bytes((protocol2.BROADCAST, *body, Instruction.STATUS))
        self._start = re.compile(re.escape(start))
        self._rows = np.dtype(
            [("error", "u1"), ("id", "u1"), ("data", "u1", self._lengths[0]), ("crc", "<u2")]
        )

    def decode(self, buffer: bytes) -> Replies | None:
        """Decode the frame if it is there, whole and of the right devices."""
        self.stale = 0
        for start in self._start.finditer(buffer):
            frame = buffer[start.start() : start.start() + self.size]
            if len(frame) < self.size:
                return None
            if protocol2.crc16(frame[:-2]) != frame[-2] | frame[-1] << 8:
                continue
            rows = np.frombuffer(frame, self._rows, offset=protocol2.PREFIX + 1)
            if rows["id"].tobytes() != self._order:
                self.stale += 1
                continue
            return Replies(rows["id"], rows["error"], rows["data"])
        return None

    def salvage(self, buffer: bytes) -> list[Status]:
        """Decode the replies of a damaged frame up to the first damaged one.

        Those of silent devices may be missing in between.
        """
        best: list[Status] = []
        for start in self._start.finditer(buffer):
            frame = buffer[start.start() : start.start() + self.size]
            statuses = protocol2.decode_fast_status(frame, self._lengths)
            places = [self._order.find(status.id) for status in statuses]
            if places == sorted(set(places)) and -1 not in places:
                best = max(best, statuses, key=len)
        return best


class SyncWriter:
    """Builds sync writes of one item from arrays; rows are filled in place."""

    def __init__(
        self, address: int, kind: str, devices: Sequence[int], wire: Wire = PROTOCOL_2
    ) -> None:
        """Prepare to write an item of a numpy type, such as "<i4", to devices in this order."""
        self.address, self._wire = address, wire
        self._rows = np.zeros(len(devices), np.dtype([("id", "u1"), ("value", kind)]))
        self._rows["id"] = devices
        empty = protocol2.sync_write(address, {0: bytes(np.dtype(kind).itemsize)}).encode()
        length = self._rows.nbytes + 7
        self._head = empty[:5] + length.to_bytes(2, "little") + empty[7:12]

    def encode(
        self, values: NDArray[np.int_] | int, chosen: NDArray[np.bool_] | None = None
    ) -> bytes:
        """Build the frame that sets the values of all devices, or of some, by mask (n,)."""
        self._rows["value"] = values
        if chosen is None and self._wire is PROTOCOL_2:
            body = self._rows.tobytes()
            if STUFFED not in body:
                return protocol2.seal(self._head + body)
        rows = self._rows if chosen is None else self._rows[chosen]
        data = {int(row["id"]): row["value"].tobytes() for row in rows}
        return self._wire.encode(protocol2.sync_write(self.address, data))
