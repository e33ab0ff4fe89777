"""Tables are read by the types of a dataclass; every problem is reported with its place."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pytest
from msgspec import Meta

from robots.quaternion import Array
from robots.storage.validation import (
    MAX_TOML,
    Names,
    Sign,
    load_toml,
    on_axes,
    positive,
    read_table,
    whole,
)


@dataclass(frozen=True)
class Part:
    name: str
    size: Annotated[int, whole(1, 9)]


@dataclass(frozen=True, kw_only=True)
class Whole:
    title: str
    sign: Sign
    color: Literal["red", "green", "blue"]
    length: Annotated[float, positive(2.0, "m")]
    names: Names
    matrix: Annotated[Array, on_axes(2)]
    parts: tuple[Part, ...]
    best: Part
    limits: dict[str, Annotated[float, positive(1.0)]]
    axes: Annotated[tuple[Sign, Sign], Meta(description="two signs")]
    facts: dict[str, Annotated[str | int | float | None, Meta(description="text or number")]]
    loud: bool = False
    spare: Part | None = None


RIGHT = {
    "title": "N·m",
    "sign": -1,
    "color": "blue",
    "length": 2,
    "names": ["a", "b"],
    "matrix": [[1, 2], [3, 4]],
    "parts": [{"name": "x", "size": 1}, {"name": "y", "size": 9}],
    "best": {"name": "x", "size": 1},
    "limits": {"a": 0.5},
    "axes": [1, -1],
    "facts": {"a": "", "b": None, "c": 3},
}


def test_a_right_table_is_read_with_its_defaults():
    problems: list[str] = []
    read = read_table(Whole, RIGHT, "", problems)
    assert problems == []
    assert (read.title, read.sign, read.color, read.length) == ("N·m", -1, "blue", 2.0)
    assert (read.names, read.axes, read.limits) == (("a", "b"), (1, -1), {"a": 0.5})
    assert np.array_equal(read.matrix, [[1.0, 2.0], [3.0, 4.0]])
    assert (read.parts, read.best) == ((Part("x", 1), Part("y", 9)), Part("x", 1))
    assert read.facts == {"a": "", "b": None, "c": 3}
    assert (read.loud, read.spare) == (False, None)


WRONG = [
    ("title", "", "title is '', expected a text"),
    ("title", "a\nb", r"title is 'a\nb', expected a text"),
    ("sign", 0, "sign is 0, expected -1 or 1"),
    ("color", "pink", "color is 'pink', expected red, green, blue"),
    ("length", 1e-320, "length is 1e-320 m, expected at least 1e-09 m, at most 2 m"),
    ("length", 3, "length is 3 m, expected above 0 m, at most 2 m"),
    ("length", float("nan"), "length is nan m, expected above 0 m, at most 2 m"),
    ("length", 10**400, "length is an integer of 1329 bits, expected above 0 m, at most 2 m"),
    ("names", [], "names is [], expected a list of texts, at least one"),
    ("names", ["a", "a"], "names is ['a', 'a'], expected each name once"),
    ("matrix", [[1], [2, 3]], "matrix is [[1], [2, 3]], expected finite numbers on 2 axes"),
    ("parts", [], "parts is [], expected a list of tables, at least one"),
    ("parts", [{"name": "x", "size": 0}], "part 'x': size is 0, expected an integer from 1 to 9"),
    ("parts", [{"size": 1}], "part number 1: name is missing, expected a text"),
    ("best", 3, "best is 3, expected a table"),
    ("best", {"name": "x", "size": 2.0}, "best.size is 2.0, expected an integer from 1 to 9"),
    ("limits", {"a": 0, "b": 2}, "limits.a is 0, expected above 0, at most 1; limits.b is 2"),
    ("limits", {"a\nb": 0}, r"limits.'a\nb' is 0"),
    ("axes", [1], "axes is [1], expected two signs"),
    ("axes", [1, 2], "axes[1] is 2, expected -1 or 1"),
    ("facts", {"a": [1]}, "facts.a is [1], expected text or number"),
    ("loud", 1, "loud is 1, expected true or false"),
    ("spare", {"name": "x"}, "spare.size is missing, expected an integer from 1 to 9"),
]


@pytest.mark.parametrize(("key", "value", "message"), WRONG)
def test_a_wrong_value_is_reported_with_its_place_and_what_is_expected(key, value, message):
    problems: list[str] = []
    read = read_table(Whole, RIGHT | {key: value}, "", problems)
    assert message in "; ".join(problems)
    assert "\n" not in "; ".join(problems)
    assert read.best is not None, "what else is in the table is not read"


def test_all_problems_are_reported_at_once_and_read_as_blanks():
    problems: list[str] = []
    blank = read_table(Whole, {"parts": [{}, {}]}, "at: ", problems)
    assert len(problems) == 10 + 4
    assert all(problem.startswith(("at: ", "at: part number")) for problem in problems)
    assert (blank.title, blank.sign, blank.names, blank.axes) == ("", 0, (), ())
    assert np.isnan(blank.length)
    assert blank.matrix.shape == (0, 0)
    assert blank.best == Part("", -1)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a." * 100_000 + b"b = 1", r"not TOML \(a key has 50 parts or more\)"),
        (b"[" + b'"x" . ' * 100_000 + b"b]", "a key has 50 parts or more"),
        (b"x = {" + b"'a'." * 100_000 + b"b = 1}", "a key has 50 parts or more"),
        (b"x = " + b"[" * 100_000, "nested too deep"),
        (b"a = 1\xff", r"not UTF-8 text \(byte 5\)"),
        ("a = 1".encode("utf-16"), "not UTF-8 text"),
        (b"#" * (MAX_TOML + 1), f"more than {MAX_TOML} bytes"),
    ],
)
def test_a_file_that_is_no_plain_toml_is_refused(tmp_path: Path, content: bytes, message: str):
    (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(ValueError, match=message):
        load_toml(tmp_path / "a.toml")
