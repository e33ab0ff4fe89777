"""Questions on a bus find their answers, and only theirs."""

import time

import numpy as np
import pytest
from fast_status import encode_fast_status
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.dynamixel import protocol2
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import known_models, table_named
from drivers.dynamixel.protocol2 import FrameParser, Packet, Span, Status
from drivers.dynamixel.requests import GroupLayout, Replies, Request, SyncWriter

SPAN = Span(126, 10)


class ScriptedPort:
    path, baud, is_open = "script", 1_000_000, True

    def __init__(self, *answers: list[bytes]) -> None:
        self.answers = list(answers)
        self.chunks: list[bytes] = []
        self.sent: list[bytes] = []
        self.waits: list[float] = []
        self.unread = 0

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        self.chunks += self.answers.pop(0) if self.answers else []

    def read(self, deadline: float) -> bytes:
        self.waits.append(deadline - time.monotonic())
        return self.chunks.pop(0) if self.chunks else b""

    def flush(self) -> int:
        count = sum(map(len, self.chunks)) + self.unread
        self.chunks, self.unread = [], 0
        return count


def bus_with(*answers: list[bytes]) -> DynamixelBus:
    return DynamixelBus(ScriptedPort(*answers), sleeps=False)


def row(device: int, fill: int = 0, length: int = 10) -> Status:
    return Status(device, 0, bytes([fill]) * length)


def ask_group(bus: DynamixelBus, ids, *, fast: bool = False, length: int = 10) -> Replies:
    request = Request.group(dict.fromkeys(ids, Span(126, length)), fast=fast)
    bus.begin(request)
    return bus.collect_group(request)


def test_a_silent_device_is_no_error_and_is_asked_as_often_as_wanted():
    bus = bus_with()
    assert bus.ping(3, tries=3) is None
    assert len(bus.port.sent) == 3
    assert bus.statistics.lost == 3 and bus.statistics.retries == 2
    pongs = [Status(i, 0, b"\xfc\x03\x2e").encode() for i in (1, 4, 200)]
    found = bus_with([b"".join(pongs)]).ping_all()
    assert sorted(found) == [1, 4, 200]
    assert found[4].data == b"\xfc\x03\x2e"


def test_answers_of_others_of_other_lengths_and_damaged_ones_are_not_taken():
    bus = bus_with([row(4, 1).encode(), row(3, 2, 9).encode(), row(3, 3).encode()])
    assert bus.read(3, SPAN) == row(3, 3)
    assert bus.statistics.stale == 2
    good, echo = row(3, 2).encode(), protocol2.read(3, SPAN).encode()
    bad = good[:12] + bytes([good[12] ^ 1]) + good[13:]
    bus = bus_with([b"\xff\xff\x00", echo, bad, b"\x55\xff", good])
    assert bus.read(3, SPAN) == row(3, 2)
    assert bus.statistics.damaged == 1


def test_a_deadline_is_the_time_on_the_wire_and_the_margin(monkeypatch):
    """The window of a broadcast ping is that of 253 slots; a request after it is due as any."""
    monkeypatch.setattr(time, "monotonic", lambda: 1000.0)
    bus = bus_with()
    bus.return_delay, bus.answer_margin = 0.001, 0.5
    bus.send(bytes(1000))  # 10 ms at 1 Mbit/s, before the request can begin
    bus.read(3, SPAN)
    # 14 bytes of request, 21 of answer.
    assert bus.port.waits[0] == pytest.approx(0.010 + 35e-5 + 0.001 + 0.5)
    bus = bus_with()
    bus.answer_margin = 0.004
    assert bus.ping_all() == {}
    # 10 bytes of ping; then 253 slots of 3 ms and the 14 bytes of a reply.
    window = 10e-5 + 253 * (0.003 + 14e-5) + 0.004
    assert bus.port.waits == [pytest.approx(window)]
    assert bus.read(3, SPAN) is None
    # The ping's own 10 bytes; 14 bytes of request and 21 of reply, which waits its delay.
    assert bus.port.waits[1] == pytest.approx(10e-5 + 35e-5 + 500e-6 + 0.004)


def test_a_fast_frame_gives_all_values_and_errors_before_any_damage():
    statuses = [Status(5, 0x80, bytes(range(10))), Status(2, 0, bytes(range(10, 20)))]
    frame = bytearray(encode_fast_status(statuses))
    replies = ask_group(bus_with([bytes(frame)]), (5, 2), fast=True)
    assert (replies.devices.tolist(), replies.errors.tolist()) == ([5, 2], [0x80, 0])
    assert replies.column(6, "<i4").tolist() == [0x09080706, 0x13121110]
    frame[8 + 14 + 5] ^= 4
    replies = ask_group(bus_with([bytes(frame)]), (5, 2), fast=True)
    assert replies.devices.tolist() == [5] and replies.is_damaged


def test_a_fast_frame_of_another_order_is_an_old_one():
    old = encode_fast_status([row(1, 9), row(2, 9)])
    new = encode_fast_status([row(2, 2), row(1, 1)])
    bus = bus_with([old, new])
    message = ask_group(bus, (2, 1), fast=True)
    assert message.data[:, 0].tolist() == [2, 1]
    assert bus.statistics.stale == 1
    assert not len(ask_group(bus_with([old]), (2, 1), fast=True).devices)


@settings(max_examples=100, deadline=None)
@given(
    fill=st.lists(st.integers(0, 255), min_size=6, max_size=6),
    flips=st.lists(st.tuples(st.integers(0, 91), st.integers(0, 7)), max_size=8),
    before=st.binary(max_size=10) | st.binary(max_size=400),
)
def test_no_flipped_bits_and_no_junk_make_a_wrong_value(fill, flips, before):
    for fast in (True, False):
        assert not len(ask_group(bus_with([before]), (1, 2, 3), fast=fast).devices)
    ids = range(1, 7)
    frame = bytearray(encode_fast_status([row(i, f) for i, f in zip(ids, fill, strict=True)]))
    for place, bit in flips:
        frame[place] ^= 1 << bit
    message = ask_group(bus_with([before + bytes(frame)]), ids, fast=True)
    assert flips or len(message.devices) == 6
    for device, data in zip(message.devices, message.data, strict=True):
        assert data.tolist() == [fill[device - 1]] * 10


@settings(max_examples=100, deadline=None)
@given(values=st.lists(st.integers(-(2**31), 2**31 - 1), min_size=3, max_size=3))
def test_a_sync_write_is_what_the_protocol_builds(values):
    writer = SyncWriter(116, "<i4", [1, 20, 252])
    rows = [value.to_bytes(4, "little", signed=True) for value in values]
    expected = protocol2.sync_write(116, dict(zip((1, 20, 252), rows, strict=True))).encode()
    assert writer.encode(np.array(values)) == expected
    some = np.array([True, False, True])
    (packet,) = FrameParser().feed(writer.encode(np.array(values), some))
    assert isinstance(packet, Packet) and len(packet.params) == 4 + 2 * 5


LAYOUTS = {
    name: GroupLayout.of(table_named(name)) for name in known_models() if table_named(name).is_servo
}


@given(model=st.sampled_from(list(LAYOUTS)), data=st.data())
def test_an_array_of_replies_decodes_as_each_register_alone(model: str, data: st.DataObject):
    layout = LAYOUTS[model]
    length = layout.span.length
    rows = data.draw(st.lists(st.binary(min_size=length, max_size=length), min_size=1, max_size=4))
    replies = Replies.of([Status(i, 0, row) for i, row in enumerate(rows)], length)
    for item in (layout.load, layout.velocity, layout.position):
        at = item.address - layout.span.address
        expected = [item.decode(row[at : at + item.size]) for row in rows]
        assert layout.decode(item, replies).tolist() == expected
