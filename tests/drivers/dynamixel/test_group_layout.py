"""Load, velocity and position of a cycle's replies, as arrays and as single registers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel.control_table import known_models, table_named
from drivers.dynamixel.group_layout import GroupLayout
from drivers.dynamixel.protocol2 import Span, Status
from drivers.dynamixel.requests import Replies

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


@pytest.mark.parametrize(
    ("model", "span"),
    [
        ("XM430-W350", Span(126, 10)),
        ("AX-12A", Span(36, 6)),
        ("MX-28(1.0)", Span(36, 6)),
        ("XL-320", Span(37, 6)),
        ("STS3215", Span(56, 6)),
    ],
)
def test_they_lie_side_by_side(model: str, span: Span):
    assert LAYOUTS[model].span == span
