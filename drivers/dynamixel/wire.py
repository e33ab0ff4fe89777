"""What differs between the protocols of servo buses: the frames, and the instructions there are."""

from __future__ import annotations

from typing import Protocol

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol1 import FEETECH, PROTOCOL_1
from drivers.dynamixel.protocol2 import Damaged, FrameParser, Instruction, Packet, Status


class Wire(Protocol):
    """A protocol on a bus. Packets are the same in all of them: see `protocol2.Packet`."""

    @property
    def name(self) -> str:
        """Return its name, as in a control table."""
        ...

    @property
    def header(self) -> bytes:
        """Return the bytes with which a frame begins."""
        ...

    @property
    def overhead(self) -> int:
        """Return the bytes of a reply around its data."""
        ...

    @property
    def max_id(self) -> int:
        """Return the highest id of a device."""
        ...

    @property
    def instructions(self) -> frozenset[int]:
        """Return the instructions that all its devices know."""
        ...

    def encode(self, packet: Packet) -> bytes:
        """Build the frame of an instruction."""
        ...

    def encode_status(self, status: Status) -> bytes:
        """Build the frame of a reply."""
        ...

    def decode_status(self, packet: Packet) -> Status:
        """Decode a reply that a parser found."""
        ...

    def parse_replies(self) -> FrameParser:
        """Return a parser of replies."""
        ...

    def parse_instructions(self) -> FrameParser:
        """Return a parser of instructions."""
        ...


class Frame2:
    """The frame of Dynamixel Protocol 2.0."""

    name = "2.0"
    header = protocol2.HEADER
    overhead = protocol2.OVERHEAD + 1
    max_id = protocol2.MAX_ID
    instructions = frozenset(map(int, Instruction))

    def encode(self, packet: Packet) -> bytes:
        """Build the frame of an instruction."""
        return packet.encode()

    def encode_status(self, status: Status) -> bytes:
        """Build the frame of a reply."""
        return status.encode()

    def decode_status(self, packet: Packet) -> Status:
        """Decode a reply that a parser found."""
        return Status.from_packet(packet)

    def parse_replies(self) -> FrameParser:
        """Return a parser, which tells replies and instructions apart by itself."""
        return FrameParser()

    def parse_instructions(self) -> FrameParser:
        """Return the same parser."""
        return FrameParser()


PROTOCOL_2 = Frame2()
WIRES: dict[str, Wire] = {wire.name: wire for wire in (PROTOCOL_2, PROTOCOL_1, FEETECH)}
"""All protocols by name."""


def encode_item(wire: Wire, item: Packet | Damaged) -> bytes:
    """Return an instruction as on the wire, a damaged one as it was received."""
    return item.frame if isinstance(item, Damaged) else wire.encode(item)
