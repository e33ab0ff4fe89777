"""Validation of users' files by the types of dataclasses; all problems are reported at once.

A dataclass states what a table holds: types, `Literal` choices and `Annotated` limits. msgspec
converts each value; a value that is missing or wrong adds one problem, with its place and what is
expected, and reads as a blank, so that one pass finds all problems. What was read is used only
if there is no problem.
"""

from __future__ import annotations

import math
import re
import reprlib
import sys
import tomllib
import types
from collections.abc import Callable, Collection, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
import numpy as np
from msgspec import Meta

from robots.storage.files import describe, read_bounded

MAX_TEXT = 4 * 2**20  # bytes; far above what such a file needs
MAX_TOML = 2**20  # bytes
MOST_ROWS = 2000  # tables of one list
MOST_PARTS = 50  # of a dotted key
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
LONG_KEY = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")
LEAST = 1e-9  # of numbers above 0, in any unit: less is none, and its inverse may be infinite
MOST_UNKNOWN = 20  # keys that are named
MANY = 3  # names that one message still lists

T = TypeVar("T")
if TYPE_CHECKING:
    Sign = int  # of which a type checker cannot see that it is -1 or 1
else:
    Sign = Literal[-1, 1]
Names = Annotated[tuple[str, ...], Meta(min_length=1)]
Angle = Annotated[float, Meta(description="a finite angle in rad")]


def whole(lower: int, upper: int) -> Meta:
    """Limit an integer to [lower, upper]."""
    return Meta(ge=lower, le=upper)


def positive(upper: float, unit: str = "") -> Meta:
    """Limit a number to above 0, at most ``upper``; its inverse must be a number, too."""
    return Meta(ge=LEAST, le=upper, extra={"unit": unit})


def within(lower: float, upper: float, unit: str = "") -> Meta:
    """Limit a number to [lower, upper]."""
    expected = f"{lower:g} to {upper:g} {unit}".rstrip()
    return Meta(ge=lower, le=upper, description=expected, extra={"unit": unit})


def on_axes(count: int) -> Meta:
    """Require an array to have a number of axes."""
    lists = "a list of finite numbers" if count == 1 else f"finite numbers on {count} axes"
    return Meta(description=lists, extra={"axes": count})


def read_table(
    kind: type[T],
    table: dict[str, Any],
    place: str,
    problems: list[str],
    *,
    required: Collection[str] = (),
) -> T:
    """Read a table into a dataclass.

    Args:
        kind: Dataclass whose fields are the table's keys, or name them in their metadata; unknown
            keys are ignored.
        table: What TOML or JSON holds.
        place: What the messages begin with: "" or, for example, "joint 'l_knee': ".
        problems: Problems are appended here.
        required: Keys that the table must have although their fields have a default.
    """
    values = {}
    for field in fields(kind):  # type: ignore[arg-type]
        key, hint = field.metadata.get("key", field.name), _hints(kind)[field.name]
        name = f"{place}{key}"
        is_optional = field.default is not MISSING or field.default_factory is not MISSING
        if key in table:
            values[field.name] = _read(hint, table[key], name, problems)
        elif not is_optional or key in required:
            problems.append(f"{name} is missing, expected {_describe(hint)}")
            values[field.name] = _blank(hint)
    return kind(**values)


def find_unknown_keys(kind: type, table: dict[str, Any], place: str = "") -> list[str]:
    """Report keys without a field in a dataclass, in a table and the tables within it."""
    names = {field.metadata.get("key", field.name): field.name for field in fields(kind)}
    problems, unknown = [], []
    for key, value in table.items():
        name = f"{place}{_as_key(key)}"
        if key not in names:
            unknown.append(name)
            continue
        base = _split(_hints(kind)[names[key]])[0]
        item = _item_type(base)
        if is_dataclass(base) and isinstance(value, dict):
            problems += find_unknown_keys(base, value, f"{name}.")  # type: ignore[arg-type]
        elif is_dataclass(item) and isinstance(value, list):
            for number, row in enumerate(value[:MOST_ROWS], start=1):
                if isinstance(row, dict):
                    where = _row_place(name, row, number)
                    problems += find_unknown_keys(item, row, where)  # type: ignore[arg-type]
    expected = f"expected {', '.join(names)}"
    problems += [f"unknown key {name}, {expected}" for name in unknown[:MOST_UNKNOWN]]
    if len(unknown) > MOST_UNKNOWN:
        problems.append(f"{len(unknown) - MOST_UNKNOWN} more unknown keys")
    return problems


def load_toml(file: Path) -> dict[str, Any]:
    """Load a TOML file; raises as `parse_file`."""

    def parse(text: str) -> dict[str, Any]:
        if LONG_KEY.search(text):  # tomllib's time grows with the square of the parts
            raise ValueError(f"a key has {MOST_PARTS} parts or more")
        return tomllib.loads(text)

    return parse_file(file, "TOML", parse, MAX_TOML)


def parse_file(
    file: Path, language: str, parse: Callable[[str], T], max_bytes: int = MAX_TEXT
) -> T:
    """Parse a text file in a language such as "TOML"; raise `ValueError` with one line why not."""
    try:
        content = read_bounded(file, max_bytes)
    except OSError as error:
        raise ValueError(describe(error)) from error
    try:
        return parse(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise ValueError(f"not UTF-8 text (byte {error.start})") from error
    except RecursionError as error:
        raise ValueError(f"not {language} (nested too deep)") from error
    except ValueError as error:
        raise ValueError(f"not {language} ({' '.join(str(error).split())})") from error


def name_missing_joints(missing: Sequence[str], count: int) -> list[str]:
    """Report joints that a file lacks, by name if they are few, of ``count`` joints in all."""
    if len(missing) > MANY:
        return [f"{len(missing)} of {count} joints are missing"]
    return [f"joint {shown(name)} is missing" for name in missing]


def name_unknown_joints(unknown: Sequence[str], expected: Sequence[str]) -> list[str]:
    """Report joints in a file that the robot lacks."""
    if not unknown:
        return []
    first = ", ".join(map(shown, unknown[:MANY])) + (", ..." if len(unknown) > MANY else "")
    what = "unknown joint" if len(unknown) == 1 else f"{len(unknown)} unknown joints:"
    return [f"{what} {first}, expected {', '.join(expected)}"]


def _read(hint: Any, value: Any, place: str, problems: list[str]) -> Any:
    base, meta = _split(hint)
    item = _item_type(base)
    if is_dataclass(base) and isinstance(value, dict):
        return read_table(base, value, f"{place}.", problems)  # type: ignore[arg-type]
    is_filled = isinstance(value, dict) and len(value) >= (meta.min_length or 0)
    if get_origin(base) is dict and is_filled:
        return {
            key: _read(item, content, f"{place}.{_as_key(key)}", problems)
            for key, content in value.items()
        }
    is_vector = get_origin(base) is tuple and get_args(base)[-1] is not ...
    if is_vector and isinstance(value, list) and len(value) == len(get_args(base)):
        elements = zip(get_args(base), value, strict=True)
        return tuple(
            _read(element, x, f"{place}[{i}]", problems) for i, (element, x) in enumerate(elements)
        )
    if is_dataclass(item):
        if isinstance(value, list) and len(value) > MOST_ROWS:
            problems.append(f"{place} has {len(value)} tables, expected at most {MOST_ROWS}")
            return ()
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            return tuple(
                read_table(item, row, _row_place(place, row, i), problems)  # type: ignore[arg-type]
                for i, row in enumerate(value, start=1)
            )
    else:
        try:
            return _convert(hint, value)
        except _DuplicateError:
            problems.append(f"{place} is {shown(value)}, expected each name once")
            return _blank(hint)
        except (ValueError, TypeError, OverflowError):  # msgspec's errors among them
            pass
    expected = _describe(hint)
    if isinstance(value, float) and 0.0 < value < LEAST:
        expected = expected.replace("above 0", f"at least {LEAST:g}")
    unit = ""
    if isinstance(value, int | float) and not isinstance(value, bool):
        unit = (meta.extra or {}).get("unit", "") if abs(value) <= sys.float_info.max else ""
    problems.append(f"{place} is {f'{shown(value)} {unit}'.rstrip()}, expected {expected}")
    return _blank(hint)


class _DuplicateError(ValueError):
    """A list holds a name twice."""


def _convert(hint: Any, value: Any) -> Any:
    base, meta = _split(hint)
    if get_origin(base) is np.ndarray:
        if not _holds_numbers(value):
            raise ValueError("not numbers alone")
        array = np.array(value, dtype=float)
        if array.ndim != (meta.extra or {}).get("axes") or not np.isfinite(array).all():
            raise ValueError("not finite numbers on the expected axes")
        return array
    converted = msgspec.convert(value, hint, strict=True)
    parts = converted if isinstance(converted, tuple) else (converted,)
    if any(isinstance(part, float) and not math.isfinite(part) for part in parts):
        raise ValueError("not a finite number")
    if get_origin(base) is not Union and not isinstance(base, types.UnionType):
        texts = [part for part in parts if isinstance(part, str)]
        if not all(text.strip() and text.isprintable() for text in texts):
            raise ValueError("an empty or unprintable text")
        if get_origin(base) is tuple and len(set(texts)) < len(texts):
            raise _DuplicateError
    return converted


def _holds_numbers(value: Any) -> bool:
    """Return whether nested lists hold numbers alone: no texts, and neither true nor false."""
    if isinstance(value, list):
        return all(map(_holds_numbers, value))
    return isinstance(value, int | float) and not isinstance(value, bool)


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _split(hint: Any) -> tuple[Any, Meta]:
    """Split a type into the type without None and its limits."""
    meta = Meta()
    if get_origin(hint) is Annotated:
        hint, meta = get_args(hint)[:2]
    if isinstance(hint, types.UnionType) or get_origin(hint) is Union:
        rest = [option for option in get_args(hint) if option is not type(None)]
        if len(rest) == 1:
            return _split(rest[0])
    return hint, meta


def _item_type(base: Any) -> Any:
    arguments = get_args(base)
    if get_origin(base) is dict:
        return arguments[1]
    return arguments[0] if get_origin(base) is tuple and arguments[1:] == (...,) else None


def _row_place(place: str, row: dict[str, Any], number: int) -> str:
    owner = place.removesuffix("es" if place.endswith("xes") else "s")
    name = row.get("name")
    return f"{owner} {shown(name)}: " if isinstance(name, str) else f"{owner} number {number}: "


def _as_key(key: str) -> str:
    return key if key.replace("-", "_").isidentifier() else shown(key)


def _describe(hint: Any) -> str:
    base, meta = _split(hint)
    if meta.description:
        return meta.description
    if get_origin(base) is Literal:
        choices = get_args(base)
        return (" or " if isinstance(choices[0], int) and len(choices) == 2 else ", ").join(
            map(str, choices)
        )
    if base is int:
        return f"an integer from {meta.ge} to {meta.le}"
    if base is float:
        unit = (meta.extra or {}).get("unit", "")
        return f"above 0 {unit}".rstrip() + f", at most {meta.le:g} {unit}".rstrip()
    if get_origin(base) is tuple:
        what = "tables" if is_dataclass(_item_type(base)) else "texts"
        return f"a list of {what}, at least one"
    return {str: "a text", bool: "true or false"}.get(base, "a table")


def _blank(hint: Any) -> Any:
    """Return a stand-in for a value that is missing or wrong."""
    base, meta = _split(hint)
    if is_dataclass(base):
        return read_table(base, {}, "", [])  # type: ignore[arg-type]
    if get_origin(base) is Literal:
        return type(get_args(base)[0])()
    if get_origin(base) is np.ndarray:
        return np.zeros((0,) * (meta.extra or {})["axes"])
    blanks = {int: -1, float: math.nan, str: "", bool: False, dict: {}, tuple: ()}
    return blanks.get(get_origin(base) or base)


class _Shown(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write an integer of more than 4300 digits.
        if x.bit_length() <= 64:
            return super().repr_int(x, level)
        return f"an integer of {x.bit_length()} bits"


_SHOWN = _Shown()
_SHOWN.maxstring = 60


def shown(value: Any) -> str:
    """Format any value of a file in a few characters on one line."""
    return _SHOWN.repr(value)


def outside(value: float, lower: float, upper: float, unit: str) -> str:
    """Describe a value outside its range, with enough decimals to show the difference."""
    is_close = min(abs(value - lower), abs(value - upper)) < 1e-3
    decimals = 9 if is_close else 3
    # Beyond a thousand decimals are noise, and a float may have 308 digits.
    number = f"{value:+.{decimals}f}" if abs(value) < 1e3 else f"{value:+.3e}"
    expected = f"[{lower:+.{decimals}f}, {upper:+.{decimals}f}]"
    return f"{number} {unit}, expected {expected} {unit}"
