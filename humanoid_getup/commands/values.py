"""Values of requests, checked by the types of their fields as those of files are.

Problems name fields as the command line does: `--torque-limit`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from tyro.conf import Positional

from robots.storage.validation import (
    UNFIT,
    describe_misfit,
    fit,
    hints_of,
    name_choices,
    split_hint,
)


@dataclass(frozen=True)
class Items:
    """Further rules for a list of any length; used in `Annotated`."""

    twice: bool = False
    """Whether an item may occur twice."""
    none: bool = False
    """Whether it may be empty although its default is not; '' is no item then."""


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


def convert_value(value: Any, hint: Any) -> Any:
    """Convert a text to a path or a path to a text, as expected, and a list to a tuple.

    Numbers and texts of NumPy become Python's own.
    """
    base, *_ = split_hint(hint)
    if isinstance(value, str | Path) and base in (str, Path):
        return base(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, list | tuple) and (items := find_items(hint)):
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
    try:
        fit(hint, value)
    except UNFIT:
        return describe_misfit(hint, value, _describe_kind(hint, value))
    return None


def _find_list_problem(value: Any, hint: Any, default: Any) -> str | None:
    """Return the problem of a list of any length; ``None`` if there is none."""
    items = find_items(hint)
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


def find_items(hint: Any) -> tuple[Any, ...]:
    """Return the types of a list's items, with an ellipsis for any number; () for no list."""
    base, *_ = split_hint(hint)
    return get_args(base) if get_origin(base) is tuple else ()


def _describe_kind(hint: Any, value: Any) -> str:
    """Describe a type that the command line names in its own way: a choice, or a list."""
    base, *_ = split_hint(hint)
    if get_origin(base) is Literal:
        return name_choices(get_args(base))
    if not (items := find_items(hint)):
        return "True or False" if base is bool else ""
    plural = {float: "numbers", int: "whole numbers", Path: "files"}.get(items[0], "names")
    count = plural if items[-1] is ... else f"{len(items)} {plural}"
    if isinstance(value, str) and items[0] in (int, float):
        return f"{count} with commas between them"
    return f"a tuple of {count}"
