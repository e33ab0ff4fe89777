"""TOML that is written is read as it was, and looks as people write it."""

import tomllib

import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from robots.storage.toml_document import commented, in_line, one_a_line, table_of, tables_of

KEYS = st.text(min_size=1, max_size=8)
VALUES = st.integers(-9, 9) | st.booleans() | st.text(max_size=8) | st.floats(allow_nan=False)


def write(**items) -> str:
    document = tomlkit.document()
    for key, item in items.items():
        document.add(key, item)
    return document.as_string()


@given(row=st.dictionaries(KEYS, VALUES | st.dictionaries(KEYS, VALUES, max_size=3), max_size=4))
def test_a_table_in_one_line_is_read_as_it_was(row: dict):
    text = write(row=in_line(row))
    assert tomllib.loads(text) == {"row": row}
    assert text.count("\n") <= 1


@given(rows=st.lists(st.fixed_dictionaries({"a": VALUES, "b": VALUES, "c": VALUES}), max_size=4))
def test_columns_change_spaces_alone(rows: list[dict]):
    text = write(rows=one_a_line(rows, in_columns=True))
    assert tomllib.loads(text) == {"rows": rows}
    plainly = write(rows=one_a_line(rows))
    assert text.replace(" ", "") == plainly.replace(" ", "")


def test_keys_stand_below_each_other_up_to_one_that_a_row_lacks():
    rows = [{"name": "l", "id": 3, "gear": 2.5, "end": 1}, {"name": "right", "id": 12, "end": 1}]
    assert write(joints=one_a_line(rows, in_columns=True)).splitlines() == [
        "joints = [",
        '    {name = "l",     id = 3, gear = 2.5, end = 1},',
        '    {name = "right", id = 12, end = 1},',
        "]",
    ]


def test_tables_and_comments():
    first = {"joints": ["a", "b"], "matrix": commented([[1, 0.5]], "turns")}
    assert write(rows=tables_of([first, {"x": 1}]), end=table_of({"y": 2}, "why")) == (
        '[[rows]]\njoints = ["a", "b"]\nmatrix = [[1, 0.5]] # turns\n\n[[rows]]\nx = 1\n\n'
        "[end]\n# why\ny = 2\n"
    )
