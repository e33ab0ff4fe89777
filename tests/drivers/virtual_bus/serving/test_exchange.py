"""A client's bytes become instructions, these reach devices, and replies the client."""

from itertools import pairwise

from fake_devices import FakeDevices
from fake_wire import FakeWire, exchange_with
from fault_injector import LineFault
from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel import protocol2
from drivers.dynamixel.protocol2 import BROADCAST, Damaged, FrameParser, Instruction, Packet, Span
from drivers.virtual_bus.serving.exchange import (
    LONGEST_GAP,
    Exchange,
    InstructionReader,
    ReceivedInstruction,
    WireStatistics,
    expects_reply,
)

IDS = (1, 2, 3)
BAUD = 1_000_000
READ = protocol2.read(2, Span(132, 4)).encode()


def received(frame: bytes, *, baud: int = BAUD) -> ReceivedInstruction:
    (item,) = FrameParser().feed(frame)
    return ReceivedInstruction(item, len(frame), 0.0, baud)


def test_what_no_device_hears_is_unanswered_and_other_replies_are_counted():
    devices = FakeDevices(IDS)
    exchange, faults = exchange_with(devices)
    assert exchange.run(received(READ, baud=57_600)) == devices.heard == []
    assert (exchange.statistics.unanswered, exchange.statistics.wrong_baud) == (1, 1)
    faults.strike_next(LineFault.ECHO)
    echo, reply = exchange.run(received(READ))
    assert (echo.data, echo.delay) == (READ, 0.0), "an echo comes first"
    assert (reply.device, len(reply.data), exchange.statistics.answers) == (2, 15, 1)
    devices.heard.clear()
    faults.silence()
    assert exchange.run(received(READ)) == devices.heard == []


def deliver(exchange: Exchange, wire: FakeWire, baud: int) -> tuple[int, int, int]:
    exchange.deliver(wire, bytes(15), baud)
    statistics = exchange.statistics
    return statistics.bytes_out, statistics.overflow, statistics.missed


def test_every_byte_for_the_client_is_delivered_lost_or_missed():
    exchange, _ = exchange_with(FakeDevices(IDS))
    wire = FakeWire(BAUD)
    assert deliver(exchange, wire, BAUD) == (15, 0, 0)
    wire.room = 4
    assert deliver(exchange, wire, BAUD) == (19, 11, 0)
    assert deliver(exchange, wire, 57_600) == (19, 11, 15)
    wire.plugged = False
    assert deliver(exchange, wire, 57_600) == (19, 26, 15)


def test_a_client_waits_for_whatever_a_device_confirms():
    for device, instruction, expected in (
        (1, Instruction.PING, True),
        (BROADCAST, Instruction.PING, True),
        (BROADCAST, Instruction.SYNC_READ, True),
        (BROADCAST, Instruction.FAST_BULK_READ, True),
        (BROADCAST, Instruction.SYNC_WRITE, False),
        (BROADCAST, Instruction.WRITE, False),
        (1, Instruction.WRITE, True),
        (1, Instruction.ACTION, False),
    ):
        assert expects_reply(Packet(device, instruction)) == expected, instruction
    assert expects_reply(Damaged(BROADCAST, Instruction.SYNC_WRITE, b""))


# Instructions, however their bytes are cut -------------------------------------------------------

BYTE = 1e-5  # s
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


def test_a_pause_within_an_instruction_or_where_time_does_not_count_the_next_breaks_it_off():
    reader, statistics = make_reader(timed=True)
    end = 1.0 + 6 * BYTE  # of the first six bytes on the wire
    assert reader.receive(READ[:6], 1.0, BAUD) == []
    assert reader.receive(READ[6:], end + LONGEST_GAP + 1e-6, BAUD) == []
    assert (statistics.broken_off, statistics.packets) == (1, 0)
    assert len(reader.receive(READ, 2.0, BAUD)) == 1
    reader, statistics = make_reader()
    reader.receive(READ[:6], 0.0, BAUD)
    assert len(reader.receive(READ, 0.0, BAUD)) == 1
    assert (statistics.broken_off, statistics.noise) == (1, 6)
    (one,) = reader.receive(READ[:-1] + bytes([READ[-1] ^ 1]), 0.0, BAUD)
    assert isinstance(one.item, Damaged) and statistics.damaged == 1
