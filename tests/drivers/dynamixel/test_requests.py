"""Requests, the bytes of their replies, and replies as arrays."""

import numpy as np
import pytest

from drivers.dynamixel.protocol2 import Instruction, Span, Status
from drivers.dynamixel.requests import Replies, Request

POSITION = Span(132, 4)


@pytest.mark.parametrize(
    ("spans", "fast", "instruction"),
    [
        ({3: POSITION}, False, Instruction.READ),
        ({3: POSITION}, True, Instruction.FAST_SYNC_READ),
        ({3: POSITION, 7: POSITION}, False, Instruction.SYNC_READ),
        ({3: POSITION, 7: POSITION}, True, Instruction.FAST_SYNC_READ),
        ({3: POSITION, 7: Span(124, 2)}, False, Instruction.BULK_READ),
    ],
)
def test_a_group_is_read_by_the_shortest_instruction(spans, fast, instruction):
    request = Request.group(spans, fast=fast)
    assert request.frame[7] == instruction
    assert request.lengths == {device: span.length for device, span in spans.items()}
    assert request.places == {device: place for place, device in enumerate(spans)}


def test_the_bytes_of_the_replies_are_those_of_the_manual():
    """A status has 11 bytes beside its data; a fast one 8, and 4 beside each device's data."""
    spans = dict.fromkeys(range(1, 21), Span(126, 10))
    assert Request.group(spans).reply_size == 20 * 21
    assert Request.group(spans, fast=True).reply_size == 8 + 20 * 14


def replies(*rows: tuple[int, int, bytes]) -> Replies:
    return Replies.of([Status(*row) for row in rows], 4)


def test_numbers_are_columns_of_the_data():
    found = replies((1, 0, b"\xfe\xff\x10\x00"), (2, 0x80, b"\x01\x00\xff\xff"))
    assert found.column(0, "<i2").tolist() == [-2, 1]
    assert found.column(2, "<i2").tolist() == [16, -1]
    assert found.column(0, "<i4").tolist() == [0x10FFFE, -65535]
    assert (found.devices.tolist(), found.errors.tolist()) == ([1, 2], [0, 0x80])


def test_statuses_of_another_length_are_left_out():
    assert replies((1, 7, b""), (2, 0, bytes(4)), (3, 0, bytes(5))).devices.tolist() == [2]
    assert Replies.of([], 4).data.shape == (0, 4)


def test_a_later_reply_is_appended_and_cut_to_the_shorter_data():
    first = replies((1, 0, b"abcd"))
    later = Replies.of([Status(2, 3, b"wxyzzz")], 6, is_damaged=True)
    both = first.join(later)
    assert [bytes(row) for row in both.data] == [b"abcd", b"wxyz"]
    assert (both.errors.tolist(), both.is_damaged) == ([0, 3], True)
    assert both.select(np.array([False, True])).devices.tolist() == [2]
