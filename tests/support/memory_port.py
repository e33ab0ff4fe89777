"""A port in memory: instructions go straight to a chain of virtual servos.

For tests and fuzzers: no thread, no pseudo-terminal, and any reply can be modified.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.dynamixel.protocol2 import Packet
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.serial_port import PortLostError, PortRefusedError
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.serving.exchange import Physics, expects_reply
from drivers.virtual_bus.serving.lock_step import QUIET


class MemoryPort:
    """Replies at once; ``spoil`` modifies replies, ``unplugged`` makes every access fail."""

    def __init__(self, chain: Chain, baud: int, physics: Physics | None = None) -> None:
        """Plug a port into a chain.

        Args:
            chain: Devices on the port; None for a port that is never written to.
            baud: Baud rate [bit/s].
            physics: Physics behind them, advanced by one period per sync write of goals.
        """
        self.chain, self.baud, self.physics = chain, baud, physics
        self.path = "memory"
        self.is_open = False
        self.unplugged = False
        """True when the adapter was unplugged."""
        self.opened = 0
        self.sent: list[Packet] = []
        self.spoil: Callable[[Packet, list[bytes]], list[bytes]] = lambda _, answers: answers
        """Modifies the replies to an instruction."""
        self.late: list[bytes] = []
        """Delivered before the next instruction's replies."""
        wire = PROTOCOL_2 if chain is None else chain.wire
        self._parser, self._came, self._time = wire.parse_instructions(), b"", 0.0

    def open(self) -> None:
        """Open the port."""
        if self.unplugged:
            raise PortRefusedError(self.path, "does not exist")
        self.opened += not self.is_open
        self.is_open = True

    def close(self) -> None:
        """Close the port."""
        self.is_open = False

    def set_baud(self, baud: int) -> None:
        """Set the baud rate [bit/s]."""
        self.baud = baud

    def write(self, data: bytes) -> None:
        """Execute instructions at once."""
        self._check()
        for packet in self._parser.feed(data):
            if not isinstance(packet, Packet):
                raise ValueError("the driver sent a damaged frame")
            self.sent.append(packet)
            answers = [a.data for a in self.chain.handle(packet, baud=self.baud)]
            answers = self.spoil(packet, answers)
            self._came += b"".join([*self.late, *answers])
            self.late = []
            if self.physics is not None and self.chain.cycle_end.is_ended_by(packet):
                self.physics.pass_period()
            elif expects_reply(packet) and not answers:
                self._pass(QUIET)

    def read(self, deadline: float) -> bytes:
        """Return the bytes received so far, without waiting."""
        del deadline
        self._check()
        came, self._came = self._came, b""
        return came

    def flush(self) -> int:
        """Discard the bytes received so far; return their number."""
        self._check()
        count, self._came = len(self._came), b""
        return count

    def frames(self, instruction: int) -> list[Packet]:
        """Return the packets sent with one instruction."""
        return [packet for packet in self.sent if packet.instruction == instruction]

    def _pass(self, duration: float) -> None:
        if self.physics is not None:
            self.physics.advance(self.physics.time + duration)
        else:
            self._time += duration
            self.chain.advance(self._time)

    def _check(self) -> None:
        if self.unplugged or not self.is_open:
            raise PortLostError(self.path)
