"""Values of requests, checked by type: choices by `Literal`, numbers by `Range`.

Problems name fields as the command line does: `--torque-limit`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from tyro.conf import Positional

MOST = 1_000_000
"""Largest count."""
MOST_SHOWN = 100  # characters of a value
KINDS = {
    int: "a whole number",
    float: "a number",
    bool: "True or False",
    Path: "a file or folder",
    str: "a text",
}
"""What is expected, by type."""


@dataclass(frozen=True)
class Range:
    """Range of finite numbers that an option accepts; used in `Annotated`."""

    lower: float
    upper: float
    unit: str = ""
    step: int = 1
    """A whole number must be a multiple of it."""

    def __contains__(self, value: float) -> bool:
        is_step = isinstance(value, float) or value % self.step == 0
        return self.lower <= value <= self.upper and is_step

    def __str__(self) -> str:
        prefix = "" if self.step == 1 else f"a multiple of {self.step}, "
        return f"{prefix}{self.lower:g} to {self.format(self.upper)}"

    def format(self, value: float) -> str:
        """Write a number with the unit."""
        number = str(value) if isinstance(value, int) else f"{value:g}"
        return f"{number} {self.unit}".rstrip()


@dataclass(frozen=True)
class Items:
    """Further rules for a list of any length; used in `Annotated`."""

    twice: bool = False
    """Whether an item may occur twice."""
    none: bool = False
    """Whether it may be empty although its default is not; '' is no item then."""


def at_least(lower: int, *, at_most: int = MOST, step: int = 1) -> Range:
    """Accept whole numbers from a lower limit, or multiples of ``step``."""
    return Range(lower, at_most, step=step)


def between(lower: float, upper: float, unit: str = "") -> Range:
    """Accept numbers from a lower to an upper limit."""
    return Range(lower, upper, unit)


def name_choices(names: Sequence[str]) -> str:
    """Format choices as text: a, b or c."""
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


def find_value_problems(options: Any) -> list[str]:
    """Report every field of a dataclass whose value does not fit its type and range.

    A positional one of a wrong type, which no command line gives, is reported by its field's name.
    """
    problems = []
    for field in fields(options):
        value, hint = getattr(options, field.name), hints_of(type(options))[field.name]
        owner = name_option(field.name, hint)
        problem = _find_problem(value, hint)
        if problem and not owner.startswith("--"):
            owner = field.name
        if problem := problem or _find_list_problem(value, hint, field.default):
            problems.append(f"{owner} {problem}")
    return problems


def list_options(request: type) -> list[str]:
    """List the options of a request as the command line names them."""
    hints = hints_of(request)
    return [name_option(field.name, hints[field.name]) for field in fields(request)]


@cache
def hints_of(request: type) -> Mapping[str, Any]:
    """Return the types of a request's fields, with their annotations."""
    return get_type_hints(request, include_extras=True)


def convert_value(value: Any, hint: Any) -> Any:
    """Convert a text to a path or a path to a text, as expected, and a list to a tuple."""
    kinds, _ = split_hint(hint)
    if isinstance(value, str) and Path in kinds:
        return Path(value)
    if isinstance(value, Path) and str in kinds:
        return str(value)
    if isinstance(value, list | tuple) and (items := find_items(kinds)):
        return tuple(convert_value(item, items[0]) for item in value)
    return value


def name_option(name: str, hint: Any) -> str:
    """Write the name of a field as the command line does: --torque-limit, or MOTION."""
    notes = [note for note in list_notes(hint) if not isinstance(note, type)]
    if Positional in notes:
        return next(
            (str(note.metavar) for note in notes if _has_text(note, "metavar")), name.upper()
        )
    name = next((str(note.name) for note in notes if _has_text(note, "name")), name)
    return f"--{name.replace('_', '-')}"


def _has_text(note: Any, attribute: str) -> bool:
    return isinstance(getattr(note, attribute, None), str)


def list_notes(hint: Any) -> Iterator[Any]:
    """Yield the annotations of a type in `Annotated`, and of the types within it."""
    for part in get_args(hint):
        yield part
        yield from list_notes(part)


def _find_problem(value: Any, hint: Any) -> str | None:
    """Describe a wrong value and what is expected; ``None`` if the value fits."""
    kinds, limits = split_hint(hint, keep_none=True)
    is_number = not isinstance(value, bool) and isinstance(value, int | float)
    if is_number and limits and value not in limits:
        return f"is {limits.format(value)}, expected {limits}"
    if limits and isinstance(value, tuple):
        numbers = (item for item in value if isinstance(item, int | float))
        if outside := [item for item in numbers if item not in limits]:
            return f"has {limits.format(outside[0])}, expected {limits}"
    is_nan = isinstance(value, float) and math.isnan(value)
    if not is_nan and any(_fits(value, kind) for kind in kinds):
        return None
    number = f", {limits}" if limits else ""
    return f"is {_show(value)}, expected {_describe(kinds - {NoneType}, value)}{number}"


def _fits(value: Any, kind: Any) -> bool:
    """Return whether a value is of a type: an int is a float as well, a bool is no number."""
    if items := get_args(kind):
        if get_origin(kind) is Literal:
            return value in items
        if not isinstance(value, tuple):
            return False
        expected = items[:1] * len(value) if items[-1] is ... else items
        return len(value) == len(expected) and all(map(_fits, value, expected))
    if isinstance(value, bool):
        return kind is bool
    return isinstance(value, int | float if kind is float else kind)


def _show(value: Any) -> str:
    """Write any value in one line."""
    line = f"'{value}'" if isinstance(value, str | Path) else " ".join(repr(value).split())
    return line if len(line) <= MOST_SHOWN else f"{line[:MOST_SHOWN]}..."


def _describe(kinds: set[Any], value: Any) -> str:
    """Describe what is expected instead of a value."""
    if choices := list_choices(kinds):
        return name_choices(choices)
    if items := find_items(kinds):
        return _describe_items(items, value)
    return next(name for kind, name in KINDS.items() if kind in kinds)


def _find_list_problem(value: Any, hint: Any, default: Any) -> str | None:
    """Return the problem of a list of any length; ``None`` if there is none."""
    items = find_items(split_hint(hint)[0])
    if not items or items[-1] is not ... or not isinstance(value, tuple):
        return None
    accepted = next((note for note in list_notes(hint) if isinstance(note, Items)), Items())
    if value in ((), ("",)) and accepted.none:
        return None
    if value == ("",) or (not value and default not in ((), MISSING)):
        return "is empty, expected a name or more"
    if "" in value:
        return f"is '{','.join(value)}', expected a name between the commas"
    twice = next((item for item in value if value.count(item) > 1), None)
    if twice is None or accepted.twice:
        return None
    return f"has '{twice}' twice, expected each once"


def split_hint(hint: Any, *, keep_none: bool = False) -> tuple[set[Any], Range | None]:
    """Split a field's type into the types of its values, by default without `None`, and a range."""
    limits = None
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        limits = next((note for note in notes if isinstance(note, Range)), None)
    is_union = get_origin(hint) in (Union, UnionType)
    kinds = {
        get_args(kind)[0] if get_origin(kind) is Annotated else kind
        for kind in (get_args(hint) if is_union else [hint])
    }
    return kinds if keep_none else kinds - {NoneType}, limits


def list_choices(kinds: set[Any]) -> tuple[str, ...]:
    """Return the choices among types of values."""
    return tuple(c for kind in kinds if get_origin(kind) is Literal for c in get_args(kind))


def find_items(kinds: set[Any]) -> tuple[Any, ...]:
    """Return the types of a list's items, with an ellipsis for any number; () for no list."""
    return next((get_args(kind) for kind in kinds if get_origin(kind) is tuple), ())


def _describe_items(items: tuple[Any, ...], value: Any) -> str:
    plural = {float: "numbers", int: "whole numbers", Path: "files"}.get(items[0], "names")
    count = plural if items[-1] is ... else f"{len(items)} {plural}"
    if isinstance(value, str) and items[0] in (int, float):
        return f"{count} with commas between them"
    return f"a tuple of {count}"
