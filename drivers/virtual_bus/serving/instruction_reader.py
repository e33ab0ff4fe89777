"""Parses the bytes of a client into instructions."""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.dynamixel.bus import BITS_PER_BYTE
from drivers.dynamixel.protocol2 import Damaged, Packet
from drivers.dynamixel.wire import PROTOCOL_2, Wire

LONGEST_GAP = 0.0015  # s between two bytes of an instruction (e-manual)


@dataclass
class WireStatistics:
    """Counts since the bus was started; of instructions unless stated otherwise."""

    bytes_in: int = 0
    """Bytes sent by clients."""
    bytes_out: int = 0
    """Bytes delivered to clients."""
    packets: int = 0
    """Instructions whose CRC matched when they left the client."""
    answers: int = 0
    """Replies of devices; each device's part of a fast reply is one."""
    damaged: int = 0
    """Instructions whose CRC did not match when they left the client."""
    noise: int = 0
    """Bytes from clients that belong to no instruction."""
    broken_off: int = 0
    """Instructions dropped because of a gap between two of their bytes."""
    wrong_baud: int = 0
    """Instructions sent at a rate that no device is set to."""
    unanswered: int = 0
    """Instructions that expect a reply and got none."""
    overflow: int = 0
    """Bytes lost because the client did not read."""
    missed: int = 0
    """Bytes lost because the client changed its baud rate before they arrived."""
    deliveries: int = 0
    """Batches of bytes delivered in real time."""
    lateness_total: float = 0.0
    """Sum of their delays behind the wire's own timing [s]."""


@dataclass(frozen=True)
class ReceivedInstruction:
    """An instruction as received from a client."""

    item: Packet | Damaged
    size: int
    """Bytes since the end of the previous one, noise included."""
    arrival: float
    """Time at which its last bytes arrived [s]."""
    baud: int
    """Baud rate of the client [bit/s]."""


class InstructionReader:
    """Finds instructions in a byte stream and counts the mistakes of clients."""

    def __init__(self, statistics: WireStatistics, *, timed: bool, wire: Wire = PROTOCOL_2) -> None:
        """Start with an empty buffer.

        If ``timed``, a gap inside an instruction drops it, else the beginning of the next one.
        """
        self._statistics, self._timed, self._wire = statistics, timed, wire
        self._parser = wire.parse_instructions()
        self._next_frame = re.compile(b"(?=" + re.escape(wire.header) + b")")
        self._last_byte = 0.0
        self._unclaimed = 0

    def receive(self, data: bytes, at: float, baud: int) -> list[ReceivedInstruction]:
        """Parse bytes that arrive at a time [s] and a baud rate; return complete instructions."""
        parser, statistics = self._parser, self._statistics
        statistics.bytes_in += len(data)
        if parser.pending and self._breaks_off(data, at):
            parser.reset()
            statistics.broken_off += 1
        self._last_byte = max(self._last_byte, at) + len(data) * byte_time(baud)
        found: list[ReceivedInstruction] = []
        # A piece from one header to the next ends where its instruction does.
        for piece in self._next_frame.split(data):
            items = parser.feed(piece)
            self._unclaimed += len(piece)
            for item in items:
                is_damaged = isinstance(item, Damaged)
                statistics.damaged += is_damaged
                statistics.packets += not is_damaged
                whole = self._unclaimed - parser.pending
                self._unclaimed = parser.pending
                found.append(ReceivedInstruction(item, whole, at, baud))
        statistics.noise = parser.noise
        return found

    def _breaks_off(self, data: bytes, at: float) -> bool:
        if self._timed:
            return at - self._last_byte > LONGEST_GAP
        return data.startswith(self._wire.header)


def byte_time(baud: int) -> float:
    """Return the duration of a byte on the wire [s], 0 without a baud rate."""
    return BITS_PER_BYTE / baud if baud else 0.0
