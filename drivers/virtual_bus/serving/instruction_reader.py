"""From the bytes of a client to the instructions that are on the wire."""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.dynamixel.protocol2 import HEADER, Damaged, FrameParser, Packet
from drivers.virtual_bus.serving.interfaces import WireStatistics

LONGEST_GAP = 0.0015  # s between two bytes of an instruction (e-manual)

_NEXT_FRAME = re.compile(b"(?=" + re.escape(HEADER) + b")")
_RUN = b"\xff\xff\xfd"


@dataclass(frozen=True)
class Request:
    """An instruction as it came from the client."""

    item: Packet | Damaged
    size: int
    """Bytes from the end of the one before to its own last byte, noise included."""
    arrival: float
    """Time at which its last bytes came in [s]."""
    baud: int
    """Rate that the client had set [bit/s]."""
    unstuffed: bool = False
    """Whether it holds FF FF FD without the FD that must follow."""


class Listener:
    """Finds instructions, and notes what clients do wrong."""

    def __init__(self, statistics: WireStatistics, *, timed: bool) -> None:
        """Listen.

        Args:
            statistics: Where to count.
            timed: Whether a gap inside an instruction breaks it off. Without, an
                instruction ends where another one begins.
        """
        self._statistics, self._timed = statistics, timed
        self._parser = FrameParser()
        self._last_byte = 0.0
        self._unclaimed = 0

    def hear(self, data: bytes, at: float, baud: int, byte_time: float) -> list[Request]:
        """Take bytes; return the instructions that they complete.

        Args:
            data: Bytes in a row.
            at: When they came [s].
            baud: The client's rate [bit/s].
            byte_time: How long one of them takes on the wire [s].
        """
        parser, statistics = self._parser, self._statistics
        statistics.bytes_in += len(data)
        if parser.pending and self._breaks_off(data, at):
            parser.reset()
            statistics.broken_off += 1
        self._last_byte = max(self._last_byte, at) + len(data) * byte_time
        found: list[Request] = []
        # A piece from one header to the next ends where its instruction does.
        for piece in _NEXT_FRAME.split(data):
            noise, begun = parser.noise, parser.pending + len(piece)
            items = parser.feed(piece)
            self._unclaimed += len(piece)
            for item in items:
                size = begun - parser.pending - (parser.noise - noise)
                unstuffed = self._note(item, size)
                whole = self._unclaimed - parser.pending
                self._unclaimed = parser.pending
                found.append(Request(item, whole, at, baud, unstuffed))
        statistics.noise = parser.noise
        return found

    def _breaks_off(self, data: bytes, at: float) -> bool:
        if self._timed:
            return at - self._last_byte > LONGEST_GAP
        return data.startswith(HEADER)

    def _note(self, item: Packet | Damaged, size: int) -> bool:
        """Count an instruction; tell whether it misses stuffing."""
        statistics = self._statistics
        if isinstance(item, Damaged):
            statistics.damaged += 1
            return False
        statistics.packets += 1
        unstuffed = _RUN in item.params and size < len(item.encode())
        statistics.unstuffed += unstuffed
        return unstuffed
