"""Values of requests, checked by type: choices by `Literal`, numbers by `Range`.

Problems name fields as the command line does: `--torque-limit`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import MISSING, dataclass, fields
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from tyro.conf import Positional

MOST = 1_000_000
"""Largest count."""


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
    """Report every field of a dataclass whose value does not fit its type and range."""
    hints = get_type_hints(type(options), include_extras=True)
    problems = []
    for field in fields(options):
        value, hint = getattr(options, field.name), hints[field.name]
        problem = _find_problem(value, hint) or _find_list_problem(value, hint, field.default)
        if problem:
            problems.append(f"{name_option(field.name, hint)} {problem}")
    return problems


def list_options(request: type) -> list[str]:
    """List the options of a request as the command line names them."""
    hints = get_type_hints(request, include_extras=True)
    return [name_option(field.name, hints[field.name]) for field in fields(request)]


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
    kinds, limits = split_hint(hint)
    if value is None:
        return None
    if (items := find_items(kinds)) and isinstance(value, str):
        return f"is '{value}', expected {_describe_items(items)} with commas between them"
    if choices := list_choices(kinds):
        return None if value in choices else f"is {value!r}, expected {name_choices(choices)}"
    if kinds not in ({int}, {float}):
        return None
    if not isinstance(value, int | float):
        number = "a whole number" if kinds == {int} else "a number"
        return f"is {value!r}, expected {number}" + (f", {limits}" if limits else "")
    if limits is None or value in limits:
        return None
    return f"is {limits.format(value)}, expected {limits}"


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


def split_hint(hint: Any) -> tuple[set[Any], Range | None]:
    """Split a field's type into the types of its values without `None`, and their range."""
    limits = None
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        limits = next((note for note in notes if isinstance(note, Range)), None)
    is_union = get_origin(hint) in (Union, UnionType)
    return set(get_args(hint) if is_union else [hint]) - {NoneType}, limits


def list_choices(kinds: set[Any]) -> tuple[str, ...]:
    """Return the choices among types of values."""
    return tuple(c for kind in kinds if get_origin(kind) is Literal for c in get_args(kind))


def find_items(kinds: set[Any]) -> tuple[Any, ...]:
    """Return the types of a list's items, with an ellipsis for any number; () for no list."""
    return next((get_args(kind) for kind in kinds if get_origin(kind) is tuple), ())


def _describe_items(items: tuple[Any, ...]) -> str:
    number = "numbers" if items[0] is float else "whole numbers"
    return number if items[-1] is ... else f"{len(items)} {number}"
