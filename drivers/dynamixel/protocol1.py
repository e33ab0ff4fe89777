"""Encodes and decodes frames of Dynamixel Protocol 1.0, and of Feetech's bus, which has the same.

Facts: ROBOTIS e-manual, "DYNAMIXEL Protocol 1.0"; dynamixel-sdk 4.1.0 and feetech-servo-sdk 1.0.0,
which tests compare with. A frame is

    FF FF | id | length (u8) | instruction or error | parameters ... | checksum (u8)

where the length counts all bytes after itself, and the checksum is the inverted sum of all bytes
after the header. Nothing in a frame says whether it is an instruction or a reply. Addresses and
lengths have one byte. Inside the program a packet is the same in every protocol: that of
`protocol2`, with two bytes for an address; only its frame differs.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.dynamixel.protocol2 import (
    ALERT,
    Damaged,
    ErrorNumber,
    FrameParser,
    Instruction,
    Packet,
    Reset,
    Status,
)
from drivers.state import HardwareError

HEADER = b"\xff\xff"
PREFIX = 4
"""Bytes of a frame before its instruction: header, id and length."""
OVERHEAD = PREFIX + 1
"""Bytes of a frame around its parameters, without the instruction."""
BROADCAST = 0xFE
ADDRESSED = (Instruction.READ, Instruction.WRITE, Instruction.REG_WRITE)
GROUPS = (Instruction.SYNC_READ, Instruction.SYNC_WRITE)


def checksum(body: bytes) -> int:
    """Compute the checksum of the bytes between header and checksum."""
    return ~sum(body) & 0xFF


def seal(device: int, code: int, params: bytes) -> bytes:
    """Build a frame."""
    if len(params) + 2 > 0xFF:
        raise ValueError(f"a frame has {len(params)} bytes of parameters, expected at most 253")
    body = bytes((device, len(params) + 2, code)) + params
    return HEADER + body + bytes((checksum(body),))


# Parameters -----------------------------------------------------------------------------------


def narrow(packet: Packet) -> bytes:
    """Return an instruction's parameters with addresses and lengths of one byte."""
    kind, params = packet.instruction, packet.params
    if kind in ADDRESSED and len(params) >= 2:
        words = 2 if kind == Instruction.READ else 1
        return _to_bytes(params[: 2 * words]) + params[2 * words :]
    if kind in GROUPS and len(params) >= 4:
        return _to_bytes(params[:4]) + params[4:]
    if kind == Instruction.BULK_READ:
        rows = struct.iter_unpack("<BHH", params)
        return b"\x00" + bytes(b for device, at, length in rows for b in (length, device, at))
    if kind == Instruction.FACTORY_RESET:
        if params != bytes((Reset.ALL,)):
            raise ValueError("a reset of Protocol 1.0 keeps nothing")
        return b""
    return params


def widen(kind: int, params: bytes) -> bytes:
    """Return an instruction's parameters with addresses and lengths of two bytes."""
    if kind in ADDRESSED and params:
        words = 2 if kind == Instruction.READ else 1
        return _to_words(params[:words]) + params[words:]
    if kind in GROUPS and len(params) >= 2:
        return _to_words(params[:2]) + params[2:]
    if kind == Instruction.BULK_READ:
        rows = zip(params[1::3], params[2::3], params[3::3], strict=False)
        return b"".join(struct.pack("<BHH", device, at, length) for length, device, at in rows)
    return bytes((Reset.ALL,)) if kind == Instruction.FACTORY_RESET else params


def _to_bytes(words: bytes) -> bytes:
    values = [number for (number,) in struct.iter_unpack("<H", words)]
    return bytes(values)


def _to_words(values: bytes) -> bytes:
    return struct.pack(f"<{len(values)}H", *values)


# Errors ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ErrorBits:
    """Meaning of the bits of a reply's error byte."""

    alarms: Mapping[int, HardwareError]
    """Those that say what is wrong with the device, by bit."""
    refusals: Mapping[int, ErrorNumber]
    """Those that say why an instruction was refused, by bit."""

    def decode(self, error: int) -> tuple[int, int]:
        """Return the error byte as in Protocol 2.0, and the bits of `HardwareError`."""
        alarms = 0
        for bit, alarm in self.alarms.items():
            alarms |= alarm.value if error & bit else 0
        number = next((n for bit, n in self.refusals.items() if error & bit), ErrorNumber.NONE)
        return number | (ALERT if alarms else 0), alarms

    def encode(self, number: int, alarms: int) -> int:
        """Return the error byte of an `ErrorNumber` and bits of `HardwareError`."""
        error = 0
        for bit, alarm in self.alarms.items():
            error |= bit if alarms & alarm else 0
        if not number or not self.refusals:
            return error
        other = next(iter(self.refusals))
        return error | next((bit for bit, n in self.refusals.items() if n == number), other)


DYNAMIXEL_ERRORS = ErrorBits(
    alarms={1: HardwareError.VOLTAGE, 4: HardwareError.OVERHEATING, 32: HardwareError.OVERLOAD},
    refusals={
        64: ErrorNumber.INSTRUCTION,
        16: ErrorNumber.CRC,
        8: ErrorNumber.DATA_RANGE,
        2: ErrorNumber.DATA_LIMIT,
    },
)
"""Bits of an AX or MX (e-manual)."""
FEETECH_ERRORS = ErrorBits(
    alarms={
        1: HardwareError.VOLTAGE,
        2: HardwareError.ENCODER,
        4: HardwareError.OVERHEATING,
        8: HardwareError.SHOCK,
        32: HardwareError.OVERLOAD,
    },
    refusals={},
)
"""Bits of a Feetech servo, the same as of its status register (feetech-servo-sdk; bit 3 is a
current that is too high, which stands here as an electrical shock)."""


# Parsing --------------------------------------------------------------------------------------


@dataclass
class ChecksumParser(FrameParser):
    """Finds frames with a checksum in a stream of bytes: instructions, or replies."""

    of_replies: bool = False
    """Whether the frames are replies; each becomes a status whose error byte is as received."""

    def _next_frame(self) -> bytes | None:
        buffer = self._buffer
        while True:
            start = buffer.find(HEADER)
            if start < 0:
                self._drop(len(buffer) - buffer.endswith(HEADER[:1]))
                return None
            self._drop(start)
            if len(buffer) < PREFIX:
                return None
            device, length = buffer[2], buffer[3]
            if device > BROADCAST or length < 2:
                self._drop(1)  # not a frame
                continue
            end = PREFIX + length
            return bytes(buffer[:end]) if len(buffer) >= end else None

    def _open(self, frame: bytes) -> Packet | Damaged:
        device, code, params = frame[2], frame[PREFIX], frame[PREFIX + 1 : -1]
        if checksum(frame[2:-1]) != frame[-1]:
            # The header may have been part of some data: a true frame may begin inside.
            self.damaged += 1
            self._drop(1)
            return Damaged(device, Instruction.STATUS if self.of_replies else code, frame)
        del self._buffer[: len(frame)]
        if self.of_replies:
            return Packet(device, Instruction.STATUS, bytes((code,)) + params)
        return Packet(device, code, widen(code, params))


# The two buses --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame1:
    """The frame of Protocol 1.0 on one kind of bus; see `wire.Frame2`."""

    name: str
    errors: ErrorBits
    instructions: frozenset[int]
    max_id: int = 253
    header: bytes = HEADER
    overhead: int = PREFIX + 2

    def encode(self, packet: Packet) -> bytes:
        """Build the frame of an instruction."""
        return seal(packet.id, packet.instruction, narrow(packet))

    def encode_status(self, status: Status) -> bytes:
        """Build the frame of a reply."""
        error = self.errors.encode(status.number, status.alarms)
        return seal(status.id, error, status.data)

    def decode_status(self, packet: Packet) -> Status:
        """Decode a reply that a parser found."""
        error, alarms = self.errors.decode(packet.params[0])
        return Status(packet.id, error, packet.params[1:], alarms)

    def parse_replies(self) -> ChecksumParser:
        """Return a parser of replies."""
        return ChecksumParser(of_replies=True)

    def parse_instructions(self) -> ChecksumParser:
        """Return a parser of instructions."""
        return ChecksumParser()


_COMMON = frozenset({*ADDRESSED, Instruction.PING, Instruction.ACTION, Instruction.SYNC_WRITE})
PROTOCOL_1 = Frame1("1.0", DYNAMIXEL_ERRORS, _COMMON | {Instruction.FACTORY_RESET})
"""Bus of AX and MX; a bulk read is known to some models alone."""
FEETECH = Frame1("feetech", FEETECH_ERRORS, _COMMON)
"""Bus of Feetech's STS and SCS; a sync read is known to some models alone."""
