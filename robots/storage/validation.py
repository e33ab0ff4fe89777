"""Validation of users' values, in files and options, by the types of dataclasses.

A dataclass states what a table or a request holds: types, `Literal` choices and `Annotated` limits.
msgspec converts each value; one that is missing or wrong adds one problem, with its place, the
value with its unit, and what is expected, and reads as a blank, so that one pass finds all
problems. What was read is used only if there is no problem.
"""

from __future__ import annotations

import math
import re
import reprlib
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
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
from msgspec import Meta

from robots.storage.files import describe, read_bounded

MAX_TEXT = 4 * 2**20  # bytes; far above what such a file needs
MAX_TOML = 2**20  # bytes
MOST = 1_000_000
"""Largest count."""
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
RANGE = {"is_range": True}
"""Marks a `Meta` whose description is a range alone, and no kind of value."""
KINDS: Mapping[Any, str] = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    Path: "a file or folder",
    str: "a text",
}
"""What is expected, by type."""
UNFIT = (ValueError, TypeError, OverflowError)
"""Errors of `fit`, msgspec's among them."""
Names = Annotated[tuple[str, ...], Meta(min_length=1)]
Angle = Annotated[float, Meta(description="a finite angle in rad")]


def whole(lower: int, upper: int) -> Meta:
    """Limit an integer to [lower, upper]."""
    return Meta(ge=lower, le=upper, description=f"an integer from {lower} to {upper}")


def at_least(lower: int, *, at_most: int = MOST, step: int = 1) -> Meta:
    """Limit an integer from below, or multiples of ``step``."""
    multiples = "" if step == 1 else f"a multiple of {step}, "
    expected = f"{multiples}{lower} to {at_most}"
    return Meta(ge=lower, le=at_most, multiple_of=step, description=expected, extra=RANGE)


def positive(upper: float, unit: str = "") -> Meta:
    """Limit a number to above 0, at most ``upper``; its inverse must be a number, too."""
    expected = f"above {_join(0, unit)}, at most {_join(upper, unit)}"
    return Meta(ge=LEAST, le=upper, description=expected, extra={"unit": unit})


def between(lower: float, upper: float, unit: str = "") -> Meta:
    """Limit a number to [lower, upper]."""
    expected = f"{lower:g} to {_join(upper, unit)}"
    return Meta(ge=lower, le=upper, description=expected, extra={**RANGE, "unit": unit})


def on_axes(count: int) -> Meta:
    """Require an array to have a number of axes."""
    lists = "a list of finite numbers" if count == 1 else f"finite numbers on {count} axes"
    return Meta(description=lists, extra={"axes": count})


def _join(number: float, unit: str) -> str:
    return f"{number if isinstance(number, int) else format(number, 'g')} {unit}".rstrip()


def name_choices(names: Sequence[Any]) -> str:
    """Format choices as text: a, b or c."""
    *others, last = map(str, names)
    return f"{', '.join(others)} or {last}" if others else last


@contextmanager
def reading(
    place: str, error: Callable[[str], Exception] = ValueError, advice: str = ""
) -> Iterator[list[str]]:
    """Yield a list for the problems of a file; raise all of them together at the end.

    A `ValueError` or `OSError` in between, of a file that cannot be read, is raised in the same
    way.

    Args:
        place: What the message begins with, such as "style file rise.toml".
        error: Makes what is raised.
        advice: What the message ends with.
    """
    problems: list[str] = []
    try:
        yield problems
    except (ValueError, OSError) as found:
        raise error(f"{place}: {describe(found)}{advice}") from found
    if problems:
        raise error(f"{place}: {'; '.join(problems)}{advice}")


def read_table(
    kind: type[T],
    table: dict[str, Any],
    place: str,
    problems: list[str],
    *,
    is_strict: bool = False,
) -> T:
    """Read a table into a dataclass.

    Args:
        kind: Dataclass whose fields are the table's keys, or name them in their metadata.
        table: What TOML or JSON holds.
        place: What the messages begin with: "" or, for example, "joint 'l_knee': ".
        problems: Problems are appended here.
        is_strict: Whether unknown keys are problems, also those of tables within it.
    """
    values, keys = {}, []
    for field in fields(kind):  # type: ignore[arg-type]
        key, hint = field.metadata.get("key", field.name), hints_of(kind)[field.name]
        keys.append(key)
        name = f"{place}{key}"
        is_optional = field.default is not MISSING or field.default_factory is not MISSING
        if key in table:
            values[field.name] = _read(hint, table[key], name, problems, is_strict)
        elif not is_optional:
            problems.append(f"{name} is missing, expected {_describe(hint)}")
            values[field.name] = _blank(hint)
    unknown = [f"{place}{_as_key(key)}" for key in table if key not in keys] if is_strict else []
    problems += [f"unknown key {n}, expected {', '.join(keys)}" for n in unknown[:MOST_UNKNOWN]]
    if len(unknown) > MOST_UNKNOWN:
        problems.append(f"{len(unknown) - MOST_UNKNOWN} more unknown keys")
    return kind(**values)


def read_toml(kind: type[T], file: Path, problems: list[str], *, is_strict: bool = True) -> T:
    """Read a TOML file into a dataclass, as `load_toml` and `read_table` do."""
    return read_table(kind, load_toml(file), "", problems, is_strict=is_strict)


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


def _read(hint: Any, value: Any, place: str, problems: list[str], is_strict: bool) -> Any:
    base, meta, _ = split_hint(hint)
    item = _item_type(base)
    if is_dataclass(base) and isinstance(value, dict):
        return read_table(base, value, f"{place}.", problems, is_strict=is_strict)  # type: ignore[arg-type]
    is_filled = isinstance(value, dict) and len(value) >= (meta.min_length or 0)
    if get_origin(base) is dict and is_filled:
        return {
            key: _read(item, content, f"{place}.{_as_key(key)}", problems, is_strict)
            for key, content in value.items()
        }
    is_vector = get_origin(base) is tuple and get_args(base)[-1] is not ...
    if is_vector and isinstance(value, list) and len(value) == len(get_args(base)):
        elements = zip(get_args(base), value, strict=True)
        return tuple(
            _read(element, x, f"{place}[{i}]", problems, is_strict)
            for i, (element, x) in enumerate(elements)
        )
    if is_dataclass(item):
        if isinstance(value, list) and len(value) > MOST_ROWS:
            problems.append(f"{place} has {len(value)} tables, expected at most {MOST_ROWS}")
            return ()
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            places = [_row_place(place, row, number) for number, row in enumerate(value, start=1)]
            return tuple(
                read_table(item, row, owner, problems, is_strict=is_strict)  # type: ignore[arg-type]
                for owner, row in zip(places, value, strict=True)
            )
    else:
        try:
            return _check_parts(base, fit(hint, value))
        except _DuplicateError:
            problems.append(f"{place} is {shown(value)}, expected each name once")
            return _blank(hint)
        except UNFIT:
            pass
    problems.append(f"{place} {describe_misfit(hint, value)}")
    return _blank(hint)


class _DuplicateError(ValueError):
    """A list holds a name twice."""


def fit(hint: Any, value: Any) -> Any:
    """Convert a value to a field's type; raises one of `UNFIT`."""
    base, meta, takes_none = split_hint(hint)
    if value is None and takes_none:
        return None
    if "axes" in (meta.extra or {}):
        return _convert_array(value, (meta.extra or {})["axes"])
    if meta.ge is not None and (item := _item_type(base)):  # limits of a list's items
        base, meta = tuple[Annotated[item, meta], ...], Meta()
    converted = msgspec.convert(value, Annotated[base, meta], strict=True)
    if isinstance(converted, float) and not math.isfinite(converted):
        raise ValueError("not a finite number")
    return converted


def _convert_array(value: Any, axes: int) -> Any:
    import numpy as np  # takes time: options are read without it

    if not _holds_numbers(value):
        raise ValueError("not numbers alone")
    array = np.array(value, dtype=float)
    if array.ndim != axes or not np.isfinite(array).all():
        raise ValueError("not finite numbers on the expected axes")
    return array


def _holds_numbers(value: Any) -> bool:
    """Return whether nested lists hold numbers alone: no texts, and neither true nor false."""
    return all(map(_holds_numbers, value)) if isinstance(value, list) else _is_number(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _check_parts(base: Any, value: Any) -> Any:
    """Return the value of a file: finite numbers, printable texts, and each once in a list."""
    parts = value if isinstance(value, tuple) else (value,)
    if any(isinstance(part, float) and not math.isfinite(part) for part in parts):
        raise ValueError("not a finite number")
    texts = [part for part in parts if isinstance(part, str)]
    if get_origin(base) in (Union, UnionType):
        return value
    if not all(text.strip() and text.isprintable() for text in texts):
        raise ValueError("an empty or unprintable text")
    if get_origin(base) is tuple and len(set(texts)) < len(texts):
        raise _DuplicateError
    return value


def describe_misfit(hint: Any, value: Any, kind: str = "") -> str:
    """Describe a value that does not fit: itself, its unit, and what is expected instead.

    ``kind`` describes the field's type, by default as `KINDS` does.
    """
    base, meta, _ = split_hint(hint)
    given, extra, expected = shown(value), meta.extra or {}, _describe(hint, kind)
    if isinstance(value, float) and 0.0 < value < LEAST:
        expected = expected.replace("above 0", f"at least {LEAST:g}")
    if extra.get("is_range") and not (type(value) is base or (_is_number(value) and base is float)):
        expected = f"{kind or KINDS[base]}, {expected}"
    if base is float and isinstance(value, float) and value.is_integer():
        given = f"{value:.15g}"  # 0 instead of 0.0
    if isinstance(value, float) or (_is_number(value) and abs(value) <= sys.float_info.max):
        given = f"{given} {extra.get('unit', '')}".rstrip()
    return f"is {given}, expected {expected}"


@cache
def hints_of(kind: type) -> Mapping[str, Any]:
    """Return the types of a dataclass's fields, with their annotations."""
    return get_type_hints(kind, include_extras=True)


def split_hint(hint: Any) -> tuple[Any, Meta, bool]:
    """Split a type into the type without None, its limits, and whether it takes None."""
    meta, takes_none = Meta(), False
    while True:
        if get_origin(hint) is Annotated:
            hint, *notes = get_args(hint)
            meta = next((note for note in notes if isinstance(note, Meta)), meta)
        rest = [kind for kind in get_args(hint) if kind is not NoneType]
        if get_origin(hint) not in (Union, UnionType):
            return hint, meta, takes_none
        takes_none = len(rest) < len(get_args(hint))
        if len(rest) > 1:
            return hint, meta, takes_none
        hint = rest[0]


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


def _describe(hint: Any, kind: str = "") -> str:
    base, meta, _ = split_hint(hint)
    if description := meta.description or kind:
        return description
    if get_origin(base) is Literal:
        choices = get_args(base)
        return name_choices(choices) if isinstance(choices[0], int) else ", ".join(choices)
    if get_origin(base) is tuple:
        what = "tables" if is_dataclass(_item_type(base)) else "texts"
        return f"a list of {what}, at least one"
    return KINDS.get(base, "a table")


def _blank(hint: Any) -> Any:
    """Return a stand-in for a value that is missing or wrong."""
    base, meta, _ = split_hint(hint)
    if is_dataclass(base):
        return read_table(base, {}, "", [])  # type: ignore[arg-type]
    if get_origin(base) is Literal:
        return type(get_args(base)[0])()
    if axes := (meta.extra or {}).get("axes"):
        return _convert_array([], 1).reshape((0,) * axes)
    blanks = {int: -1, float: math.nan, str: "", bool: False, dict: {}, tuple: ()}
    return blanks.get(get_origin(base) or base)


class _Shown(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write an integer of more than 4300 digits.
        if x.bit_length() <= 64:
            return super().repr_int(x, level)
        return f"an integer of {x.bit_length()} bits"

    def repr_instance(self, x: object, level: int) -> str:
        if isinstance(x, Path):
            return self.repr_str(str(x), level)
        return " ".join(super().repr_instance(x, level).split())


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
