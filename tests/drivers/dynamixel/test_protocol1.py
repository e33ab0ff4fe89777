"""Protocol 1.0 against the published bytes, and the encoders of ROBOTIS and Feetech."""

import random

import dynamixel_sdk
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty
from recording_port import RecordingPort

from drivers.dynamixel import protocol2 as p2
from drivers.dynamixel.protocol1 import FEETECH, PROTOCOL_1, ChecksumParser, Frame1, seal
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction, Packet, Status
from drivers.state import HardwareError

# Published frames: e-manual, Protocol 1.0.
PUBLISHED = [
    (p2.ping(1), "FF FF 01 02 01 FB"),
    (p2.read(1, p2.Span(0x2B, 1)), "FF FF 01 04 02 2B 01 CC"),
    (p2.write(p2.BROADCAST, 3, b"\x01"), "FF FF FE 04 03 03 01 F6"),
    (Packet(0, Instruction.ACTION), "FF FF 00 02 05 F8"),
    (p2.factory_reset(0, p2.Reset.ALL), "FF FF 00 02 06 F7"),
    (
        p2.sync_write(0x1E, {0: bytes((0x10, 0, 0x50, 1)), 1: bytes((0x20, 2, 0x60, 3))}),
        "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
    ),
    (
        p2.bulk_read({1: p2.Span(0x1E, 2), 2: p2.Span(0x24, 2)}),
        "FF FF FE 09 92 00 02 01 1E 02 02 24 1D",
    ),
]


def test_instructions_are_the_published_bytes_and_are_read_back():
    for packet, published in nonempty(PUBLISHED):
        assert PROTOCOL_1.encode(packet) == bytes.fromhex(published)
        assert PROTOCOL_1.parse_instructions().feed(bytes.fromhex(published)) == [packet]


@given(
    device=st.integers(0, 253), address=st.integers(0, 255), data=st.binary(min_size=1, max_size=20)
)
def test_each_frame_is_that_of_the_vendors_encoders(device: int, address: int, data: bytes):
    handler, port = dynamixel_sdk.Protocol1PacketHandler(), RecordingPort()
    handler.writeTxOnly(port, device, address, len(data), list(data))
    assert PROTOCOL_1.encode(p2.write(device, address, data)) == port.written
    handler.readTx(port, device, address, len(data))
    assert PROTOCOL_1.encode(p2.read(device, p2.Span(address, len(data)))) == port.written
    rows = {1: data, 2: data[::-1]}
    param = [byte for i, row in rows.items() for byte in (i, *row)]
    handler.syncWriteTxOnly(port, address, len(data), param, len(param))
    assert PROTOCOL_1.encode(p2.sync_write(address, rows)) == port.written


noise = st.binary(max_size=20).map(lambda data: data.replace(b"\xff", b"\xfe"))
statuses = st.builds(Status, st.integers(0, 253), st.just(0), st.binary(max_size=30))


@given(parts=st.lists(st.tuples(noise, statuses), max_size=6), seed=st.integers(0, 2**32))
def test_replies_are_found_however_the_stream_is_cut_and_whatever_lies_between(parts, seed):
    stream = b"".join(noise + PROTOCOL_1.encode_status(status) for noise, status in parts)
    rng, parser, found = random.Random(seed), PROTOCOL_1.parse_replies(), []
    while stream:
        count = rng.choice([1, 1, 2, 5, 50, len(stream)])
        found += parser.feed(stream[:count])
        stream = stream[count:]
    assert list(map(PROTOCOL_1.decode_status, found)) == [status for _, status in parts]
    assert parser.noise == sum(len(noise) for noise, _ in parts)
    assert parser.pending == 0


@given(status=statuses, place=st.integers(2, 40), bit=st.integers(0, 7))
def test_a_flipped_bit_never_gives_another_reply(status: Status, place: int, bit: int):
    """A sum of bytes finds every single flipped bit."""
    frame = bytearray(PROTOCOL_1.encode_status(status))
    frame[place % len(frame)] ^= 1 << bit
    found = ChecksumParser(of_replies=True).feed(bytes(frame))
    whole = [item for item in found if isinstance(item, Packet)]
    assert [item for item in whole if len(item.params) == len(status.data) + 1] == []


H, E = HardwareError, ErrorNumber
# Lowest first (e-manual, Protocol 1.0): an angle's limit is the second, a checksum the fifth.
DYNAMIXEL = (H.VOLTAGE, E.DATA_LIMIT, H.OVERHEATING, E.DATA_RANGE, E.CRC, H.OVERLOAD, E.INSTRUCTION)
# feetech-servo-sdk; the fourth is current.
FEETECHS = (H.VOLTAGE, H.ENCODER, H.OVERHEATING, H.SHOCK, None, H.OVERLOAD)


@pytest.mark.parametrize(("wire", "meanings"), [(PROTOCOL_1, DYNAMIXEL), (FEETECH, FEETECHS)])
def test_each_bit_of_the_error_byte_means_what_the_maker_says(wire: Frame1, meanings: tuple):
    for place, meaning in nonempty(enumerate(meanings)):
        reply, status = seal(3, 1 << place, b""), Status(3, meaning or 0)
        if isinstance(meaning, HardwareError):
            status = Status(3, p2.ALERT, alarms=meaning)
        (packet,) = wire.parse_replies().feed(reply)
        assert isinstance(packet, Packet)
        assert wire.decode_status(packet) == status, f"bit {place}"
        assert meaning is None or wire.encode_status(status) == reply, f"bit {place}"


def test_a_frame_behind_a_header_is_found_and_what_does_not_fit_into_a_byte_is_refused():
    parser = PROTOCOL_1.parse_replies()  # a header whose length swallows part of a frame
    found = parser.feed(b"\xff\xff\x01\x04" + seal(5, 0, b"\x11"))
    assert found[-1] == Packet(5, Instruction.STATUS, b"\x00\x11")
    assert parser.damaged == 1
    with pytest.raises(ValueError, match="256"):
        PROTOCOL_1.encode(p2.read(1, p2.Span(256, 1)))
    with pytest.raises(ValueError, match="keeps nothing"):
        PROTOCOL_1.encode(p2.factory_reset(1, p2.Reset.ALL_BUT_ID))
    with pytest.raises(ValueError, match="at most 253"):
        PROTOCOL_1.encode(p2.write(1, 0, bytes(300)))
