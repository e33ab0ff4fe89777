"""Option values, checked by the type of their field: choices by `Literal`, numbers by a `Range`.

Lists are written with commas between their items: `--ways plan,robust`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

registry = ConstructorRegistry()
"""Tells tyro to hand over what it cannot convert, so that all problems are reported at once."""


@dataclass(frozen=True)
class Range:
    """Finite numbers that an option accepts; stands beside the type, in `Annotated`."""

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
    """Write choices for people: a, b or c."""
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


def find_value_faults(options: Any) -> list[str]:
    """Report every field of a dataclass whose value does not fit its type and range."""
    hints = get_type_hints(type(options), include_extras=True)
    values = {field.name: getattr(options, field.name) for field in fields(options)}
    checked = {name: _find_fault(value, hints[name]) for name, value in values.items()}
    return [f"--{name.replace('_', '-')} is {fault}" for name, fault in checked.items() if fault]


def _find_fault(value: Any, hint: Any) -> str | None:
    """Return a value that does not fit, and what is expected; ``None`` if it fits."""
    kinds, limits = _split(hint)
    if value is None:
        return None
    if (items := _find_items(kinds)) and isinstance(value, str):
        return f"'{value}', expected {_describe_items(items)} with commas between them"
    if choices := _list_choices(kinds):
        return None if value in choices else f"{value!r}, expected {name_choices(choices)}"
    if kinds not in ({int}, {float}):
        return None
    if not isinstance(value, int | float):
        number = "a whole number" if kinds == {int} else "a number"
        return f"{value!r}, expected {number}" + (f", {limits}" if limits else "")
    if limits is None or value in limits:
        return None
    return f"{limits.format(value)}, expected {limits}"


def _split(hint: Any) -> tuple[set[Any], Range | None]:
    """Split a field's type into the types of its values without `None`, and their range."""
    limits = None
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        limits = next((note for note in notes if isinstance(note, Range)), None)
    is_union = get_origin(hint) in (Union, UnionType)
    return set(get_args(hint) if is_union else [hint]) - {NoneType}, limits


def _list_choices(kinds: set[Any]) -> tuple[str, ...]:
    return tuple(c for kind in kinds if get_origin(kind) is Literal for c in get_args(kind))


def _find_items(kinds: set[Any]) -> tuple[Any, ...]:
    """Return the types of a list's items, with an ellipsis for any number; () for no list."""
    return next((get_args(kind) for kind in kinds if get_origin(kind) is tuple), ())


def _describe_items(items: tuple[Any, ...]) -> str:
    number = "numbers" if items[0] is float else "whole numbers"
    return number if items[-1] is ... else f"{len(items)} {number}"


@registry.primitive_rule
def _split_at_commas(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Read an option's list; `find_value_faults` reports one whose items cannot be converted."""
    items = _find_items(_split(info.type)[0])
    if not items or tyro.conf.Positional in info.markers:
        return None

    def construct(texts: list[str]) -> Any:
        words = [word.strip() for word in texts[0].split(",")] if texts[0] else []
        try:
            values = tuple(items[0](word) for word in words)
        except ValueError:
            return texts[0]
        return values if items[-1] is ... or len(values) == len(items) else texts[0]

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="A,B",
        instance_from_str=construct,
        is_instance=lambda value: value is None or isinstance(value, tuple),
        str_from_instance=lambda value: [",".join(map(str, value or ()))],
    )


@registry.primitive_rule
def _accept_any_text(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Convert choices and numbers where possible; `find_value_faults` reports the rest."""
    kinds, _ = _split(info.type)
    choices = _list_choices(kinds)
    if not choices and kinds not in ({int}, {float}):
        return None
    convert = str if choices else next(iter(kinds))
    takes_none = NoneType in get_args(info.type)

    def construct(texts: list[str]) -> Any:
        (text,) = texts
        if takes_none and text == "None":
            return None
        try:
            return convert(text)
        except ValueError:
            return text

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=f"{{{','.join(choices)}}}" if choices else convert.__name__.upper(),
        instance_from_str=construct,
        is_instance=lambda value: value is None or isinstance(value, int | float | str),
        str_from_instance=lambda value: [str(value)],
    )
