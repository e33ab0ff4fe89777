"""Encodes and decodes packets of Dynamixel Protocol 2.0.

Facts: ROBOTIS e-manual, "DYNAMIXEL Protocol 2.0". A frame is

    FF FF FD 00 | id | length (u16) | instruction | parameters ... | CRC (u16)

where the length counts all bytes after itself. A status has the instruction 0x55 and an
error byte before its data.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeGuard

from fastcrc.crc16 import umts

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
MAX_ID = 252
PREFIX = 7
"""Bytes of a frame before its instruction: header, id and length."""
OVERHEAD = PREFIX + 1 + 2
"""Bytes of a frame around its parameters."""
MAX_LENGTH = 4096
"""Longest accepted length field; 252 devices in a fast read need less."""
ALERT = 0x80
"""Bit of a status' error byte: the device has a hardware error."""

STUFFED = b"\xff\xff\xfd"
"""Bytes after which a body is stuffed with FD, so that no header appears in it."""


class Instruction(IntEnum):
    """Kind of a packet."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    CLEAR = 0x10
    BACKUP = 0x20
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A
    BULK_READ = 0x92
    BULK_WRITE = 0x93
    FAST_BULK_READ = 0x9A


class ErrorNumber(IntEnum):
    """Bits 0 to 6 of a status' error byte."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    CRC = 3
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


class Reset(IntEnum):
    """Registers that a factory reset sets to their defaults."""

    ALL = 0xFF
    ALL_BUT_ID = 0x01
    ALL_BUT_ID_AND_BAUD = 0x02


@dataclass(frozen=True)
class Packet:
    """Content of a frame, unstuffed."""

    id: int
    instruction: int
    params: bytes = b""

    def encode(self) -> bytes:
        """Build the frame: stuff the body, prepend the header, append the CRC."""
        body = stuff(bytes((self.instruction,)) + self.params)
        return seal(HEADER + struct.pack("<BH", self.id, len(body) + 2) + body)


@dataclass(frozen=True)
class Status:
    """Reply of a device."""

    id: int
    error: int = 0
    """Error byte: an `ErrorNumber`, and `ALERT`."""
    data: bytes = b""
    alarms: int = 0
    """Bits of `HardwareError` that the reply itself names; 0 in Protocol 2.0, which has none."""

    @property
    def alert(self) -> bool:
        """Return whether the device reports a hardware error."""
        return bool(self.error & ALERT)

    @property
    def number(self) -> int:
        """Return the error number without the alert bit, 0 for none."""
        return self.error & ~ALERT

    def encode(self) -> bytes:
        """Build the frame."""
        return Packet(self.id, Instruction.STATUS, bytes((self.error,)) + self.data).encode()

    @classmethod
    def from_packet(cls, packet: Packet) -> Status:
        """Decode a status packet.

        Raises:
            ValueError: if it is not a status.
        """
        if packet.instruction != Instruction.STATUS or not packet.params:
            raise ValueError(f"instruction 0x{packet.instruction:02X} is not a status")
        return cls(packet.id, packet.params[0], packet.params[1:])


def read_identity(pong: Status) -> tuple[int, int]:
    """Return model number and firmware version of a reply to a ping."""
    return int.from_bytes(pong.data[:2], "little"), pong.data[2]


def is_confirmed(status: Status | None) -> TypeGuard[Status]:
    """Return whether a device has carried out an instruction; ``None`` stands for silence."""
    return status is not None and not status.number


def crc16(data: bytes, start: int = 0) -> int:
    """Compute the CRC-16 of polynomial 0x8005, not reflected, from an earlier CRC on."""
    return umts(data, start)


def seal(frame: bytes) -> bytes:
    """Append the CRC of a frame, low byte first."""
    return frame + struct.pack("<H", umts(frame))


def stuff(body: bytes) -> bytes:
    """Insert FD after each FF FF FD."""
    return body.replace(STUFFED, STUFFED + b"\xfd")


def unstuff(body: bytes) -> bytes:
    """Turn each FF FF FD FD into FF FF FD."""
    return body.replace(STUFFED + b"\xfd", STUFFED)


@dataclass(frozen=True)
class Span:
    """Address and number of bytes of registers."""

    address: int
    length: int


# Instructions -------------------------------------------------------------------------------


def ping(device: int = BROADCAST) -> Packet:
    """Read the model and firmware of a device, or of all."""
    return Packet(device, Instruction.PING)


def read(device: int, span: Span) -> Packet:
    """Read registers of a device."""
    params = struct.pack("<HH", span.address, span.length)
    return Packet(device, Instruction.READ, params)


def write(device: int, address: int, data: bytes) -> Packet:
    """Write registers of a device."""
    return Packet(device, Instruction.WRITE, struct.pack("<H", address) + data)


def reboot(device: int) -> Packet:
    """Restart a device; its RAM goes back to defaults."""
    return Packet(device, Instruction.REBOOT)


def factory_reset(device: int, kept: Reset) -> Packet:
    """Set a device's EEPROM to its defaults, but for some registers; it restarts."""
    return Packet(device, Instruction.FACTORY_RESET, bytes((kept,)))


def sync_read(devices: Sequence[int], span: Span, *, fast: bool = False) -> Packet:
    """Read the same registers of several devices."""
    kind = Instruction.FAST_SYNC_READ if fast else Instruction.SYNC_READ
    params = struct.pack("<HH", span.address, span.length) + bytes(devices)
    return Packet(BROADCAST, kind, params)


def sync_write(address: int, data: Mapping[int, bytes]) -> Packet:
    """Write the same registers of several devices: bytes of one length for each."""
    length = len(next(iter(data.values())))
    rows = b"".join(bytes((device,)) + row for device, row in data.items())
    params = struct.pack("<HH", address, length) + rows
    return Packet(BROADCAST, Instruction.SYNC_WRITE, params)


def bulk_read(spans: Mapping[int, Span], *, fast: bool = False) -> Packet:
    """Read different registers of several devices."""
    kind = Instruction.FAST_BULK_READ if fast else Instruction.BULK_READ
    rows = (struct.pack("<BHH", device, s.address, s.length) for device, s in spans.items())
    return Packet(BROADCAST, kind, b"".join(rows))


def bulk_write(data: Mapping[int, tuple[int, bytes]]) -> Packet:
    """Write different registers of several devices: address and bytes for each."""
    rows = (struct.pack("<BHH", i, address, len(row)) + row for i, (address, row) in data.items())
    return Packet(BROADCAST, Instruction.BULK_WRITE, b"".join(rows))


# Fast replies -------------------------------------------------------------------------------


def decode_fast_status(frame: bytes, lengths: Sequence[int]) -> list[Status]:
    """Decode a fast frame, whole or cut: the replies up to the first damaged one.

    It is the one frame that several devices write in turn, without stuffing: each adds its error,
    id and data, and the CRC of all that came before.

    A frame of other lengths, in the order of the request, answers another one and yields no
    replies.
    """
    replies: list[Status] = []
    start, size = PREFIX + 1, 1 + sum(lengths) + 4 * len(lengths)
    if frame[:start] != HEADER + struct.pack("<BHB", BROADCAST, size, Instruction.STATUS):
        return replies
    crc = umts(frame[:start])
    for length in lengths:
        end = start + 2 + length
        row = frame[start:end]
        crc = umts(row, crc)
        written = frame[end : end + 2]
        if len(written) < 2 or struct.unpack("<H", written)[0] != crc:
            break
        replies.append(Status(row[1], row[0], row[2:]))
        start, crc = end + 2, umts(written, crc)
    return replies


# Parsing ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Damaged:
    """A frame whose CRC does not match."""

    id: int
    instruction: int
    frame: bytes

    def encode(self) -> bytes:
        """Return the frame as received."""
        return self.frame


@dataclass
class FrameParser:
    """Finds frames in a stream of bytes with noise between them."""

    noise: int = 0
    """Bytes outside any frame."""
    damaged: int = 0
    """Frames whose CRC did not match."""

    def __post_init__(self) -> None:
        self._buffer = bytearray()

    @property
    def pending(self) -> int:
        """Return the number of bytes that may still become a frame."""
        return len(self._buffer)

    def reset(self) -> None:
        """Drop an incomplete frame."""
        self.noise += len(self._buffer)
        self._buffer.clear()

    def give_up(self) -> list[Packet | Damaged]:
        """Stop waiting for the rest of an incomplete frame; return the frames inside it.

        A damaged length makes a frame swallow those behind it.
        """
        found: list[Packet | Damaged] = []
        while self._buffer:
            self._drop(1)
            found += self.feed(b"")
        return found

    def feed(self, data: bytes) -> list[Packet | Damaged]:
        """Parse bytes; return the frames that they complete.

        The parameters of a fast reply end before its last CRC, as in any frame.
        """
        self._buffer += data
        found: list[Packet | Damaged] = []
        while (frame := self._next_frame()) is not None:
            found.append(self._open(frame))
        return found

    def _next_frame(self) -> bytes | None:
        buffer = self._buffer
        while self._skip_to_header():
            if len(buffer) < PREFIX:
                return None
            device, length = buffer[4], buffer[5] | buffer[6] << 8
            if device > BROADCAST or device == 253 or not 3 <= length <= MAX_LENGTH:
                self._drop(1)  # not a frame
                continue
            end = PREFIX + length
            return bytes(buffer[:end]) if len(buffer) >= end else None
        return None

    def _skip_to_header(self) -> bool:
        start = self._buffer.find(HEADER)
        if start < 0:
            tail = next((n for n in (3, 2, 1) if self._buffer.endswith(HEADER[:n])), 0)
            self._drop(len(self._buffer) - tail)
            return False
        self._drop(start)
        return True

    def _open(self, frame: bytes) -> Packet | Damaged:
        if umts(frame[:-2]) != frame[-2] | frame[-1] << 8:
            # The header may have been part of some data: a true frame may begin inside.
            self.damaged += 1
            self._drop(1)
            return Damaged(frame[4], frame[7], frame)
        del self._buffer[: len(frame)]
        body = frame[PREFIX:-2]
        is_fast = frame[4] == BROADCAST and body[0] == Instruction.STATUS
        body = body if is_fast else unstuff(body)
        return Packet(frame[4], body[0], body[1:])

    def _drop(self, count: int) -> None:
        self.noise += count
        del self._buffer[:count]
