"""Values of requests, checked by type: choices by `Literal`, numbers by `Range`.

Problems name fields as the command line does: `--torque-limit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Range:
    """Range of finite numbers that an option accepts; used in `Annotated`."""

    lower: float
    upper: float = math.inf
    unit: str = ""
    excludes_lower: bool = False
    step: int = 1
    """A whole number must be a multiple of it."""

    def __contains__(self, value: float) -> bool:
        above = value > self.lower if self.excludes_lower else value >= self.lower
        is_step = isinstance(value, float) or value % self.step == 0
        return math.isfinite(value) and above and value <= self.upper and is_step

    def __str__(self) -> str:
        lower, upper = self.format(self.lower), self.format(self.upper)
        prefix = "" if self.step == 1 else f"a multiple of {self.step}, "
        if not self.excludes_lower:
            limits = f"{lower} or more" if math.isinf(self.upper) else f"{self.lower:g} to {upper}"
        elif math.isinf(self.upper):
            limits = f"above {lower}"
        else:
            limits = f"above {lower}, at most {upper}"
        return prefix + limits

    def format(self, value: float) -> str:
        """Write a number with the unit."""
        number = str(value) if isinstance(value, int) else f"{value:g}"
        return f"{number} {self.unit}".rstrip()


def at_least(lower: int, *, step: int = 1) -> Range:
    """Accept whole numbers from a lower limit, or multiples of ``step``."""
    return Range(lower, step=step)


def positive(unit: str = "", *, at_most: float = math.inf) -> Range:
    """Accept finite numbers above 0."""
    return Range(0.0, at_most, unit, excludes_lower=True)


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
    values = {field.name: getattr(options, field.name) for field in fields(options)}
    checked = {name: _find_problem(value, hints[name]) for name, value in values.items()}
    return [
        f"--{name.replace('_', '-')} is {problem}" for name, problem in checked.items() if problem
    ]


def _find_problem(value: Any, hint: Any) -> str | None:
    """Describe a wrong value and what is expected; ``None`` if the value fits."""
    kinds, limits = split_hint(hint)
    if value is None:
        return None
    if (items := find_items(kinds)) and isinstance(value, str):
        return f"'{value}', expected {_describe_items(items)} with commas between them"
    if choices := list_choices(kinds):
        return None if value in choices else f"{value!r}, expected {name_choices(choices)}"
    if kinds not in ({int}, {float}):
        return None
    if not isinstance(value, int | float):
        number = "a whole number" if kinds == {int} else "a number"
        return f"{value!r}, expected {number}" + (f", {limits}" if limits else "")
    if limits is None or value in limits:
        return None
    return f"{limits.format(value)}, expected {limits}"


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
