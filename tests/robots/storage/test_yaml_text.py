"""YAML: plain values of a limited size."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.storage.yaml_text import parse_yaml

yaml = pytest.importorskip("yaml")

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text("abc: -", max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab"), inner, max_size=3),
    max_leaves=12,
)


@given(value=VALUES, repeated=VALUES)
def test_what_was_written_is_read(value: object, repeated: object):
    content = [value, repeated, {"again": repeated}]  # which becomes an alias
    assert parse_yaml(yaml.safe_dump(content)) == content


def bomb(last: str) -> str:
    """Lists of nine aliases of the list before: 9^9 values in 200 bytes."""
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 9)]
    return "\n".join([*lines, last])


MERGED = "\n".join(
    ["a0: &a0 {x: 1}", *(f"a{k}: &a{k} {{<<: [{f'*a{k - 1}, ' * 9}]}}" for k in range(1, 9))]
)


@pytest.mark.parametrize(
    "text",
    [bomb("points: *a8"), MERGED, "a: &a [*a]", "a: &a {b: *a}"],
    ids=["list", "map", "own", "in"],
)
def test_aliases_that_stand_for_too_much_are_refused(text: str):
    with pytest.raises(ValueError, match="its aliases stand for too many values"):
        parse_yaml(text)


def test_tagged_objects_are_plain_values():
    assert parse_yaml("!!python/object/apply:os.system [exit]") == ["exit"]
    with pytest.raises(ValueError, match="line 1: could not determine a constructor"):
        parse_yaml("!other [exit]")
