"""Load, velocity and position of a cycle's replies, as arrays and as single registers."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel.control_table import known_models, table_named
from drivers.dynamixel.protocol2 import Status
from drivers.dynamixel.requests import GroupLayout, Replies

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
