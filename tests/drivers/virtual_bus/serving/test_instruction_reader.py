"""Instructions come out of a client's bytes, however cut, and its mistakes are counted."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import Damaged, Instruction, Packet, Span
from drivers.virtual_bus.serving.exchange import (
    LONGEST_GAP,
    InstructionReader,
    WireStatistics,
)

BAUD = 1_000_000
BYTE = 1e-5  # s
READ = protocol2.read(2, Span(132, 4)).encode()
STUFFED = Packet(1, Instruction.WRITE, b"\x00\x01\xff\xff\xfd\x07")

packets = st.builds(
    Packet,
    st.integers(0, 252),
    st.sampled_from([Instruction.PING, Instruction.READ, Instruction.WRITE]),
    st.binary(max_size=20) | st.just(STUFFED.params),
)


def make_reader(*, timed: bool = False) -> tuple[InstructionReader, WireStatistics]:
    statistics = WireStatistics()
    return InstructionReader(statistics, timed=timed), statistics


@given(sent=st.lists(packets, min_size=1, max_size=5), cuts=st.lists(st.integers(0, 150)))
def test_instructions_are_found_however_the_bytes_are_cut(sent: list[Packet], cuts: list[int]):
    reader, statistics = make_reader()
    stream = b"".join(packet.encode() for packet in sent)
    ends = sorted({cut for cut in cuts if cut < len(stream)} | {0, len(stream)})
    found = []
    for begin, end in pairwise(ends):
        found += reader.receive(stream[begin:end], 0.0, BAUD)
    assert [one.item for one in found] == sent
    assert sum(one.size for one in found) == len(stream)
    assert statistics == WireStatistics(bytes_in=len(stream), packets=len(sent))


def test_a_pause_within_an_instruction_breaks_it_off():
    reader, statistics = make_reader(timed=True)
    end = 1.0 + 6 * BYTE  # of the first six bytes on the wire
    assert reader.receive(READ[:6], 1.0, BAUD) == []
    assert reader.receive(READ[6:], end + LONGEST_GAP + 1e-6, BAUD) == []
    assert (statistics.broken_off, statistics.packets) == (1, 0)
    assert len(reader.receive(READ, 2.0, BAUD)) == 1


def test_where_time_does_not_count_the_next_instruction_breaks_off_a_half_one():
    reader, statistics = make_reader()
    reader.receive(READ[:6], 0.0, BAUD)
    assert len(reader.receive(READ, 0.0, BAUD)) == 1
    assert (statistics.broken_off, statistics.noise) == (1, 6)
    (one,) = reader.receive(READ[:-1] + bytes([READ[-1] ^ 1]), 0.0, BAUD)
    assert isinstance(one.item, Damaged) and statistics.damaged == 1
