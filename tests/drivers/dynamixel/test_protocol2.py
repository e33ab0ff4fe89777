"""Protocol 2.0 against the published bytes, a bitwise CRC, and ROBOTIS' own encoder."""

import itertools
import random

import pytest
from dynamixel_sdk import Protocol2PacketHandler
from fast_status import encode_fast_status
from hypothesis import assume, given
from hypothesis import strategies as st
from nonempty import nonempty
from recording_port import RecordingPort

from drivers.dynamixel import protocol2 as p2
from drivers.dynamixel.protocol2 import Damaged, FrameParser, Instruction, Packet, Status


def bitwise_crc(data: bytes) -> int:
    """Divide by x^16 + x^15 + x^2 + 1, bit by bit."""
    crc = 0
    for byte in data:
        for bit in range(7, -1, -1):
            carry = crc >> 15 ^ byte >> bit & 1
            crc = (crc << 1 & 0xFFFF) ^ (0x8005 if carry else 0)
    return crc


def frames_in(stream: bytes) -> set[bytes]:
    found = set()
    for start in range(len(stream)):
        if stream[start : start + 4] == p2.HEADER and len(stream) >= start + p2.PREFIX:
            length = int.from_bytes(stream[start + 5 : start + 7], "little")
            frame = stream[start : start + p2.PREFIX + length]
            whole = 3 <= length <= p2.MAX_LENGTH and len(frame) == p2.PREFIX + length
            if whole and bitwise_crc(frame[:-2]) == int.from_bytes(frame[-2:], "little"):
                found.add(frame)
    return found


def contents(frame: bytes) -> Packet:
    body = frame[p2.PREFIX : -2]
    is_fast = frame[4] == p2.BROADCAST and body[0] == Instruction.STATUS
    body = body if is_fast else body.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
    return Packet(frame[4], body[0], body[1:])


# From the e-manual; its other frames are those of the virtual bus's `test_chain.py`.
FAST = [  # data by id
    (
        {3: "A6000000", 7: "1F080000", 4: "FF030000"},
        "FFFFFD00 FE 1900 55 00 03 A6000000 8408 00 07 1F080000 16CA 00 04 FF030000 D19E",
    ),
    (
        {3: "A6000000", 7: "A501", 4: "1F"},
        "FFFFFD00 FE 1400 55 00 03 A6000000 67A4 00 07 A501 2474 00 04 1F D9C1",
    ),
]


def test_a_fast_status_is_the_published_bytes_both_ways():
    for data, published in nonempty(FAST):
        answers = [Status(device, 0, bytes.fromhex(text)) for device, text in data.items()]
        assert encode_fast_status(answers) == bytes.fromhex(published)
        lengths = [len(answer.data) for answer in answers]
        assert p2.decode_fast_status(bytes.fromhex(published), lengths) == answers


@given(data=st.binary(max_size=300), cut=st.integers(0, 300))
def test_the_crc_is_the_polynomial_division_and_can_be_continued(data: bytes, cut: int):
    assert p2.crc16(data) == bitwise_crc(data)
    assert p2.crc16(data[cut:], p2.crc16(data[:cut])) == p2.crc16(data)


# Bytes of which runs are made, so that runs are common.
tricky = st.lists(st.sampled_from([0xFF, 0xFD, 0x00, 0x55]), max_size=40).map(bytes)
some_bytes = st.one_of(st.binary(max_size=40), tricky)
ids = st.integers(0, p2.MAX_ID)
kinds = st.sampled_from([i for i in Instruction if i != Instruction.STATUS])
packets = st.builds(Packet, ids, kinds.map(int), some_bytes)
statuses = st.builds(Status, ids, st.integers(0, 255), some_bytes)


@given(body=some_bytes)
def test_stuffing_can_be_undone_and_leaves_no_header(body: bytes):
    stuffed = p2.stuff(body)
    assert p2.unstuff(stuffed) == body
    assert p2.HEADER not in stuffed
    assert len(stuffed) == len(body) + body.count(b"\xff\xff\xfd")


@given(packet=packets)
def test_frames_without_stuffing_are_those_of_the_dynamixel_sdk(packet: Packet):
    body = bytes((packet.instruction,)) + packet.params
    assume(b"\xff\xff\xfd" not in body)  # the SDK loses its own stuffing
    length = len(body) + 2
    port = RecordingPort()
    blank = [0, 0, 0, 0, packet.id, length & 255, length >> 8, *body, 0, 0]
    Protocol2PacketHandler().txPacket(port, blank)
    assert packet.encode() == port.written


quiet_noise = st.binary(max_size=20).map(lambda data: data.replace(b"\xff", b"\xfe"))


@given(parts=st.lists(st.tuples(quiet_noise, packets), max_size=6), seed=st.integers(0, 2**32))
def test_frames_are_found_however_the_stream_is_cut_and_whatever_lies_between(parts, seed):
    stream = b"".join(noise + packet.encode() for noise, packet in parts)
    rng, parser, found = random.Random(seed), FrameParser(), []
    while stream:
        count = rng.choice([1, 1, 2, 5, 50, len(stream)])
        found += parser.feed(stream[:count])
        stream = stream[count:]
    assert found == [packet for _, packet in parts]
    assert parser.noise == sum(len(noise) for noise, _ in parts)
    assert parser.pending == 0


def test_a_frame_behind_or_inside_a_damaged_one_is_found():
    ping = Packet(9, Instruction.PING)
    for start in ("FD 0300", "FF 0300", "01 0200", "01 0000", "01 FFFF"):  # impossible
        parser = FrameParser()
        assert parser.feed(p2.HEADER + bytes.fromhex(start) + ping.encode()) == [ping]
        assert parser.noise == p2.PREFIX
    outer = p2.HEADER + bytes((1, 20, 0, Instruction.WRITE)) + ping.encode() + bytes(9)
    assert FrameParser().feed(outer) == [Damaged(1, Instruction.WRITE, outer), ping]
    frames = [Status(i, 0, bytes(10)).encode() for i in range(1, 6)]
    stream = bytearray(b"".join(frames))
    stream[6] ^= 0x08  # the first frame now claims 2048 bytes more
    parser = FrameParser()
    assert parser.feed(bytes(stream)) == [], "it swallows the others until it is given up"
    found = parser.give_up()
    assert [p.id for p in found if isinstance(p, Packet)] == [2, 3, 4, 5]
    assert (parser.pending, parser.noise) == (0, len(frames[0]))


@given(sent=st.lists(packets, min_size=1, max_size=4), data=st.data())
def test_flipped_bits_never_make_a_packet_whose_crc_does_not_hold(sent, data):
    stream = bytearray(b"".join(packet.encode() for packet in sent))
    for bit in data.draw(st.lists(st.integers(0, 8 * len(stream) - 1), min_size=1, max_size=12)):
        stream[bit // 8] ^= 1 << bit % 8
    parser = FrameParser()
    found = parser.feed(bytes(stream)) + parser.give_up()
    valid = [contents(frame) for frame in frames_in(bytes(stream))]
    assert [packet for packet in found if isinstance(packet, Packet) and packet not in valid] == []


@given(packet=packets, data=st.data())
def test_up_to_three_flipped_bits_of_a_body_are_always_noticed(packet: Packet, data: st.DataObject):
    # The polynomial has the factor x + 1 and a period of 32767 bits.
    frame = bytearray(packet.encode())
    flipped = st.lists(
        st.integers(8 * p2.PREFIX, 8 * len(frame) - 1), min_size=1, max_size=3, unique=True
    )
    for bit in data.draw(flipped):
        frame[bit // 8] ^= 1 << bit % 8
    parser = FrameParser()
    first = parser.feed(bytes(frame))[0]
    assert first == Damaged(packet.id, frame[7], bytes(frame))
    assert parser.damaged >= 1


fast_answers = st.lists(statuses, min_size=1, max_size=6)


@given(answers=fast_answers, data=st.data())
def test_of_a_cut_or_damaged_fast_status_the_parts_before_are_whole(answers, data):
    frame = bytearray(encode_fast_status(answers))
    lengths = [len(a.data) for a in answers]
    ends = list(itertools.accumulate((4 + n for n in lengths), initial=p2.PREFIX + 1))[1:]
    for cut in {*ends, *(end - 1 for end in ends), *range(p2.PREFIX + 5)}:
        whole = sum(end <= cut for end in ends)
        assert p2.decode_fast_status(bytes(frame[:cut]), lengths) == answers[:whole]
    bit = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    whole = sum(end <= bit // 8 for end in ends)
    assert p2.decode_fast_status(bytes(frame), lengths) == answers[:whole]


def test_a_fast_status_of_another_length_is_the_answer_to_another_question():
    frame = encode_fast_status([Status(1, 0, bytes(4)), Status(2, 0, bytes(4))])
    assert len(p2.decode_fast_status(frame, [4, 4])) == 2
    assert p2.decode_fast_status(frame, [4]) == []
    assert p2.decode_fast_status(frame, [4, 4, 4]) == []
    assert p2.decode_fast_status(bytes(len(frame)), [4, 4]) == []  # zeros keep a CRC of 0
    for instruction in (Instruction.PING, Instruction.STATUS):
        with pytest.raises(ValueError, match="not a status"):
            Status.from_packet(Packet(1, instruction))
