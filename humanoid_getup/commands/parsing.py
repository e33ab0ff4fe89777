"""Value parsers for tyro: comma-separated lists; invalid values are reported later.

And its complaints about a command line, in one line instead of a box.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from difflib import get_close_matches
from types import NoneType
from typing import Any, Literal, get_args, get_origin

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.values import find_items
from robots.storage.validation import name_choices, split_hint

UNKNOWN, MISSING, NEAREST = "Unrecognized options:", "Missing from", "Perhaps you meant"
"""First words of the blocks in tyro's box."""
registry = ConstructorRegistry()
"""Makes tyro accept invalid values, so that all problems are reported at once."""


@registry.primitive_rule
def _split_at_commas(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Read an option's list; `find_value_problems` reports one whose items cannot be converted."""
    items = find_items(info.type)
    if not items or tyro.conf.Positional in info.markers:
        return None

    def construct(texts: list[str]) -> Any:
        words = [word.strip() for word in texts[0].split(",")]
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
    kind, *_ = split_hint(info.type)
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    if not choices and kind not in (int, float):
        return None
    convert = str if choices else kind
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


@contextmanager
def in_one_line(program: str, list_others: Callable[[str], Sequence[str]]) -> Iterator[None]:
    """Convert the box in which tyro reports errors to a `BadInputError`.

    ``list_others`` names the commands that have an option which this one has not.
    """
    with redirect_stderr(io.StringIO()) as box:
        try:
            yield
        except SystemExit as left:
            if not left.code:  # after help
                raise
            problems = describe_box(box.getvalue(), list_others)
            raise BadInputError(f"{problems}: see {program} --help") from left


def describe_box(box: str, list_others: Callable[[str], Sequence[str]]) -> str:
    """Convert a box of tyro, with rules between its blocks, to one line."""
    lines = [line[1:].rstrip(" │") for line in box.splitlines()[1:-1]]
    text = "\n".join("" if not line.strip(" ─-") else line for line in lines)
    blocks = {block.split("\n")[0].strip(): block for block in text.strip("\n").split("\n\n")}
    hint = next((_list_entries(b)[0] for h, b in blocks.items() if h.startswith(NEAREST)), "")
    problems = []
    for head, block in blocks.items():
        if head.startswith(UNKNOWN):
            words = _list_entries(block) or _flatten(block).removeprefix(UNKNOWN).split(", ")
            problems.append(_name_unknown([word.strip() for word in words], hint, list_others))
        elif head.startswith(MISSING):
            problems += [f"{name} is missing" for name in _list_entries(block)]
    if found := re.match(r"Missing value for argument '([^']*)'", _flatten(text)):
        problems.append(f"{found[1]} has no value, expected one")
    return "; ".join(problems) or _flatten(text)


def _name_unknown(
    words: Sequence[str], hint: str, list_others: Callable[[str], Sequence[str]]
) -> str:
    options = [word for word in words if word.startswith("-") and len(word) > 1]
    kind = "option" if options else "argument"
    listed = ", ".join(f"'{word}'" for word in options or words)
    unknown = f"unknown {kind} {listed}"
    if options and (others := list_others(options[0])):
        return f"{unknown}, which {name_choices(others)} has"
    nearest = get_close_matches((options or words)[0], re.findall(r"--[\w-]+", hint), 1, 0.0)
    return f"{unknown}, expected {nearest[0]}" if nearest else unknown


def _list_entries(block: str) -> list[str]:
    """List the options that a block explains: indented less than their explanations."""
    return re.findall(r"^ {5}(\S.*?) *$", block, re.MULTILINE)


def _flatten(text: str) -> str:
    return " ".join(text.split())
