"""Value parsers for tyro: comma-separated lists; invalid values are reported later."""

from __future__ import annotations

from types import NoneType
from typing import Any, get_args

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from humanoid_getup.jobs.requests.values import find_items, list_choices, split_hint

registry = ConstructorRegistry()
"""Makes tyro accept invalid values, so that all problems are reported at once."""


@registry.primitive_rule
def _split_at_commas(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Read an option's list; `find_value_problems` reports one whose items cannot be converted."""
    items = find_items(split_hint(info.type)[0])
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
    """Convert choices and numbers where possible; `find_value_problems` reports the rest."""
    kinds, _ = split_hint(info.type)
    choices = list_choices(kinds)
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
