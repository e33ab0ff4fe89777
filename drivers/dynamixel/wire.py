"""What differs between the protocols of servo buses: the frames, and the instructions there are."""

from __future__ import annotations

import struct

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol1 import FEETECH, PROTOCOL_1, Frame1
from drivers.dynamixel.protocol2 import Damaged, FrameParser, Instruction, Packet, Span, Status

PING_DATA = 3  # bytes: model number, firmware
FIRST = Span(0, 6)
"""Registers that name a device where a ping does not: AX and MX have model, firmware and id at 0,
2 and 3, Feetech's have firmware, model and id at 0, 3 and 5."""
AT_ID = {"1.0": 3, "feetech": 5}
"""Place of the id in those registers, by protocol."""


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


Wire = Frame2 | Frame1
"""A protocol on a bus. Packets are the same in all of them: see `protocol2.Packet`."""
PROTOCOL_2 = Frame2()
WIRES: dict[str, Wire] = {wire.name: wire for wire in (PROTOCOL_2, PROTOCOL_1, FEETECH)}
"""All protocols by name."""


def encode_item(wire: Wire, item: Packet | Damaged) -> bytes:
    """Return an instruction as on the wire, a damaged one as it was received."""
    return item.frame if isinstance(item, Damaged) else wire.encode(item)


def decode_identity(wire: Wire, status: Status) -> Status:
    """Return a reply as that to a ping of Protocol 2.0: model number and firmware."""
    data = status.data
    if wire is PROTOCOL_2 or len(data) < FIRST.length:
        return status
    number, firmware = data[0] | data[1] << 8, data[2]
    if wire is FEETECH:
        number, firmware = data[3] | data[4] << 8, data[0]
    return Status(status.id, status.error, struct.pack("<HB", number, firmware), status.alarms)
