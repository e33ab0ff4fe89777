"""A chain of devices on one half-duplex wire: executes instructions, orders the replies."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from drivers.dynamixel.bus import BITS_PER_BYTE
from drivers.dynamixel.control_table import ControlTable, table_named
from drivers.dynamixel.protocol2 import (
    BROADCAST,
    HEADER,
    MAX_LENGTH,
    Damaged,
    Instruction,
    Packet,
    Span,
    Status,
    crc16,
)
from drivers.dynamixel.wire import PROTOCOL_2, Wire
from drivers.virtual_bus.devices.device import Quirks, ReadGap, VirtualDevice

# s for the reply of each id to a broadcast ping: the wait of the vendor's library per id
PING_SLOT = 0.003


class Reply(NamedTuple):
    """Bytes that a device puts on the wire: a frame, or its part of a fast one."""

    device: int
    """Its id."""
    delay: float
    """Silence before them [s], since the end of the instruction or of the reply before."""
    data: bytes
    hold: float = 0.0
    """How long the adapter holds them back [s]."""


@dataclass(frozen=True)
class CycleEnd:
    """A sync write of goal positions, or of torque off to all servos that have no watchdog.

    To those without torque no goal is written, for that would switch it on.
    """

    goal: Span
    torque: Span | None
    """Register of the torque; None where goals are written to limp servos too."""
    servos: int
    """Number of servos."""

    @classmethod
    def of(cls, tables: Sequence[ControlTable]) -> CycleEnd:
        """Find it for the servos of a bus; that of the X series if there is none."""
        servos = [table for table in tables if table.is_servo] or [table_named("XM430-W350")]
        torque = None if servos[0].has_watchdog else servos[0]["torque_enable"].span
        return cls(servos[0]["goal_position"].span, torque, len(servos))

    def is_ended_by(self, item: Packet | Damaged) -> bool:
        """Return whether an instruction ends a period."""
        if isinstance(item, Damaged) or item.instruction != Instruction.SYNC_WRITE:
            return False
        if len(item.params) < 4:
            return False
        address = int.from_bytes(item.params[:2], "little")
        length = int.from_bytes(item.params[2:4], "little")
        goal, torque = self.goal, self.torque
        if address <= goal.address and address + length >= goal.address + goal.length:
            return True
        if torque is None or (address, length) != (torque.address, torque.length):
            return False
        values = item.params[5::2]
        return len(values) == self.servos and not any(values)


class Chain:
    """Passes instructions to devices and collects their replies in the order of the wire.

    Devices of the same id reply at the same time, which garbles their bytes.
    """

    def __init__(self, devices: Sequence[VirtualDevice], quirks: Quirks | None = None) -> None:
        self.devices = list(devices)
        self.quirks = quirks or Quirks()
        self.cycle_end = CycleEnd.of([device.table for device in self.devices])
        """What ends a control period in lock-step."""
        self.wire: Wire = self.devices[0].table.wire if self.devices else PROTOCOL_2
        """Protocol that all of them speak."""
        self._members: dict[int, list[VirtualDevice]] = {}

    def advance(self, now: float) -> None:
        """Advance all devices to a bus time [s]."""
        for device in self.devices:
            device.advance(now)

    def handle(self, item: Packet | Damaged, *, baud: int | None = None) -> list[Reply]:
        """Execute an instruction; return the replies in their order on the wire.

        Args:
            item: The instruction, or a damaged one.
            baud: Its baud rate [bit/s]; devices set to another ignore it. None for all devices.
        """
        self._find_listeners(baud)
        if isinstance(item, Damaged):
            return []  # a device cannot trust the id of a damaged frame
        if item.instruction == Instruction.STATUS:
            return []  # a reply of another device
        for devices in self._members.values():
            for device in devices:
                device.note_traffic()
        kind, params = item.instruction, item.params
        if item.id != BROADCAST:
            devices = self._members.get(item.id, [])
            return self._collect(devices, lambda device: device.handle(kind, params))
        if kind == Instruction.PING:
            return self._ping_all()
        if kind in READS:
            return self._reply_to_reads(kind, READS[kind](params))
        if kind in FAST_READS:
            return self._reply_to_fast(FAST_READS[kind](params))
        if kind in WRITES:
            self._write(WRITES[kind](params))
        else:
            for devices in self._members.values():
                for device in devices:
                    device.handle(kind, params, is_broadcast=True)
        return []

    def _find_listeners(self, baud: int | None) -> None:
        members: dict[int, list[VirtualDevice]] = {}
        for device in self.devices:
            if device.listens and (baud is None or device.baud == baud):
                members.setdefault(device.id, []).append(device)
        self._members = members

    def _ping_all(self) -> list[Reply]:
        """Reply to a broadcast ping: each id has its time slot."""
        replies: list[Reply] = []
        now = 0.0  # s since the instruction
        for device_id, devices in sorted(self._members.items()):
            (reply,) = self._collect(devices, lambda device: device.handle(Instruction.PING))
            delay = max(reply.delay, device_id * PING_SLOT - now)
            replies.append(Reply(device_id, delay, reply.data))
            now += delay + _duration(len(reply.data), devices[0].baud)
        return replies

    def _write(self, rows: Iterable[tuple[int, int, bytes]]) -> None:
        done: set[int] = set()
        for device_id, address, data in rows:
            if device_id in done:
                continue
            done.add(device_id)
            for device in self._members.get(device_id, ()):
                device.write(address, data)

    def _reply_to_reads(self, kind: int, spans: Mapping[int, Span]) -> list[Reply]:
        replies: list[Reply] = []
        waited = 0.0
        for device_id, span in spans.items():
            members = self._members.get(device_id, ())
            devices = [d for d in members if d.answers_reads and kind in d.table.instructions]
            if not devices:
                if self.quirks.sync_gap is ReadGap.CHAIN_BREAKS:
                    break
                waited += self._slot(span.length + self.wire.overhead)
                continue
            (reply,) = self._collect(devices, partial(_read, span))
            replies.append(Reply(reply.device, waited + reply.delay, reply.data))
            waited = 0.0
        return replies

    def _reply_to_fast(self, spans: Mapping[int, Span]) -> list[Reply]:
        """Reply to a fast read: one frame, each device's piece ending in the CRC so far."""
        length = 1 + sum(span.length + 4 for span in spans.values())
        if length > MAX_LENGTH:
            return []
        replies: list[Reply] = []
        waited, crc = 0.0, 0
        start = HEADER + struct.pack("<BHB", BROADCAST, length, Instruction.STATUS)
        for device_id, span in spans.items():
            members = self._members.get(device_id, ())
            devices = [d for d in members if d.answers_reads and d.has_fast_read]
            if not devices:
                if self.quirks.fast_gap is ReadGap.CHAIN_BREAKS:
                    break
                waited += self._slot(len(start) + span.length + 4)
                start = b""
                continue
            pieces = []
            for device in devices:
                status = _read(span, device)
                # The length was sent before, so a failed read sends zeros.
                piece = start + bytes((status.error, status.id))
                piece += status.data or bytes(span.length)
                pieces.append(piece + struct.pack("<H", crc16(piece, crc)))
            data = _garble(pieces)
            crc = crc16(data, crc)
            # All pieces together are one reply, and the delay is from instruction to reply.
            delay = waited + (0.0 if replies else devices[0].return_delay)
            replies.append(Reply(device_id, delay, data))
            waited, start = 0.0, b""
        return replies

    def _collect(
        self, devices: Sequence[VirtualDevice], handle: Callable[[VirtualDevice], Status | None]
    ) -> list[Reply]:
        """Collect the simultaneous replies of devices of one id."""
        if not devices:
            return []
        device_id, delay = devices[0].id, devices[0].return_delay  # the instruction may change them
        statuses = [handle(device) for device in devices]
        frames = [self.wire.encode_status(status) for status in statuses if status is not None]
        return [Reply(device_id, delay, _garble(frames))] if frames else []

    def _slot(self, length: int) -> float:
        """Return how long the bytes of a silent device would have taken [s]."""
        devices = next(iter(self._members.values()), None)
        return _duration(length, devices[0].baud) if devices else 0.0


def _duration(length: int, baud: int) -> float:
    return length * BITS_PER_BYTE / baud


def _read(span: Span, device: VirtualDevice) -> Status:
    error, data = device.read(span.address, span.length)
    return Status(device.id, error | device.alert, data, device.alarms)


def _garble(frames: Sequence[bytes]) -> bytes:
    """Overlay simultaneous frames, each a byte later than the last: low level wins."""
    if len(frames) == 1:
        return frames[0]
    mixed = bytearray(b"\xff" * (max(map(len, frames)) + len(frames) - 1))
    for late, frame in enumerate(frames):
        for i, byte in enumerate(frame, start=late):
            mixed[i] &= byte
    return bytes(mixed)


# Parameters of group instructions ---------------------------------------------------------------


def _sync_spans(params: bytes) -> dict[int, Span]:
    if len(params) < 5:
        return {}
    return dict.fromkeys(params[4:], Span(*struct.unpack_from("<HH", params)))


def _bulk_spans(params: bytes) -> dict[int, Span]:
    spans: dict[int, Span] = {}
    for start in range(0, len(params) - 4, 5):
        device_id, *span = struct.unpack_from("<BHH", params, start)
        spans.setdefault(device_id, Span(*span))  # an id counts once
    return spans


def _sync_rows(params: bytes) -> Iterator[tuple[int, int, bytes]]:
    if len(params) < 4:
        return
    address, length = struct.unpack_from("<HH", params)
    for start in range(4, len(params) - length, length + 1):
        yield params[start], address, params[start + 1 : start + 1 + length]


def _bulk_rows(params: bytes) -> Iterator[tuple[int, int, bytes]]:
    start = 0
    while start + 5 <= len(params):
        device_id, address, length = struct.unpack_from("<BHH", params, start)
        start += 5 + length
        if start > len(params):
            return  # cut short
        yield device_id, address, params[start - length : start]


Spans = Callable[[bytes], dict[int, Span]]
SYNC, BULK = Instruction.SYNC_READ, Instruction.BULK_READ
FAST_SYNC, FAST_BULK = Instruction.FAST_SYNC_READ, Instruction.FAST_BULK_READ
READS: dict[int, Spans] = {SYNC: _sync_spans, BULK: _bulk_spans}
FAST_READS: dict[int, Spans] = {FAST_SYNC: _sync_spans, FAST_BULK: _bulk_spans}
WRITES: dict[int, Callable[[bytes], Iterator[tuple[int, int, bytes]]]] = {
    Instruction.SYNC_WRITE: _sync_rows,
    Instruction.BULK_WRITE: _bulk_rows,
}
