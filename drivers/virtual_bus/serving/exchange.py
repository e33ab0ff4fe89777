"""Exchange between a port and the devices behind it: instructions, replies, time."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Protocol

from drivers.dynamixel.bus import BITS_PER_BYTE
from drivers.dynamixel.protocol2 import BROADCAST, Damaged, Instruction, Packet
from drivers.dynamixel.wire import PROTOCOL_2, Wire, encode_item
from drivers.virtual_bus.devices.chain import Chain, Reply
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal

GROUP_READS = (
    Instruction.SYNC_READ,
    Instruction.FAST_SYNC_READ,
    Instruction.BULK_READ,
    Instruction.FAST_BULK_READ,
)
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
        is_late = at - self._last_byte > LONGEST_GAP
        if parser.pending and (is_late if self._timed else data.startswith(self._wire.header)):
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


def byte_time(baud: int) -> float:
    """Return the duration of a byte on the wire [s], 0 without a baud rate."""
    return BITS_PER_BYTE / baud if baud else 0.0


class Physics(Protocol):
    """What a bus asks of the physics behind its devices."""

    time: float
    """Bus time that it has reached [s]."""
    is_light: bool
    """Whether it computes next to nothing, so that its thread may go before all others."""

    def advance(self, to: float) -> None:
        """Advance physics and devices to a bus time [s], or to the last step before it."""

    def pass_period(self) -> None:
        """Advance by one control period."""


class Line:
    """What is between a client and the devices: nothing here; another one may disturb it."""

    silent = False
    """Whether no instruction comes to the devices."""

    def strikes_echo(self) -> bool:
        """Return whether the adapter returns this request."""
        return False

    def disturb_request(self, item: Packet | Damaged) -> list[Packet | Damaged]:
        """Return an instruction as the devices receive it."""
        return [item]

    def disturb_reply(self, reply: Reply) -> list[Reply]:
        """Return a reply as the client receives it."""
        return [reply]


class Exchange:
    """Passes instructions to devices, and advances physics."""

    def __init__(self, devices: Chain, physics: Physics, *, advances_time: bool = True) -> None:
        """Connect devices and physics; the parameters are those of `VirtualBus`."""
        self._devices, self._physics, self.line = devices, physics, Line()
        self._advances_time = advances_time
        self.statistics = WireStatistics()
        self.wire = devices.wire
        """Protocol of the bus."""
        self.cycle_end = devices.cycle_end
        """What ends a control period in lock-step."""

    @property
    def time(self) -> float:
        """Return the bus time that physics and devices have reached [s]."""
        return self._physics.time

    def pass_until(self, to: float) -> None:
        """Advance to a bus time [s], or to the last physics step before it."""
        if self._advances_time:
            self._physics.advance(to)

    def pass_period(self) -> None:
        """Advance by one control period."""
        if self._advances_time:
            self._physics.pass_period()

    def run(self, request: ReceivedInstruction) -> list[Reply]:
        """Execute an instruction; return the replies to the client, in their order on the wire."""
        line, statistics = self.line, self.statistics
        echo = (
            [Reply(BROADCAST, 0.0, encode_item(self.wire, request.item))]
            if line.strikes_echo()
            else []
        )
        received = self._pass_on(request)
        replies = [r for item in received for r in self._devices.handle(item, baud=request.baud)]
        statistics.answers += len(replies)
        statistics.unanswered += not replies and expects_reply(request.item)
        return echo + [part for reply in replies for part in line.disturb_reply(reply)]

    def deliver(self, wire: PseudoTerminal, data: bytes, baud: int) -> None:
        """Deliver bytes that were sent at a baud rate [bit/s] to the client.

        Bytes are lost when its queue is full or when it has changed its rate since.
        """
        if wire.plugged and wire.baud != baud:
            self.statistics.missed += len(data)
            return
        taken = wire.write(data) if data else 0
        self.statistics.bytes_out += taken
        self.statistics.overflow += len(data) - taken

    def _pass_on(self, request: ReceivedInstruction) -> list[Packet | Damaged]:
        if self.line.silent:
            return []
        if all(device.baud != request.baud for device in self._devices.devices):
            self.statistics.wrong_baud += 1
            return []
        return self.line.disturb_request(request.item)


def expects_reply(item: Packet | Damaged) -> bool:
    """Return whether a client waits for a reply."""
    if isinstance(item, Damaged):
        return True
    if item.instruction in GROUP_READS or item.instruction == Instruction.PING:
        return True
    return item.id != BROADCAST and item.instruction != Instruction.ACTION
