"""Old spellings of commands, which still work; a message shows the new one."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

MOVED = {"motions play": "play"}
"""Commands that have another name."""

RENAMED = {
    "motions retarget": {"--from": "--source"},
    "train": {"--from": "--parent"},
    "style extract": {"--from": "--begin", "--to": "--end"},
    "mocap import": {"--from": "--begin", "--to": "--end"},
    "motions show": {"--out": "--picture"},
    "motions preview": {"--out": "--picture"},
    "robots check": {"--out": "--picture"},
}
"""Options that have another name, by command."""


def _is_any(_word: str) -> bool:
    return True


def _is_number(word: str) -> bool:
    return re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?|[-+]?(inf|nan)", word) is not None


def _names_port(word: str) -> bool:
    return "=" in word


def _is_none(_word: str) -> bool:
    return False


LISTS: dict[str, Callable[[str], bool]] = {
    "--at": _is_number,
    "--cases": _is_any,
    "--fix": _is_none,
    "--hold": _is_number,
    "--joint": _is_any,
    "--key": _is_none,
    "--page": str.isdecimal,
    "--policies": _is_any,
    "--port": _names_port,
    "--scenes": _is_any,
    "--servo": _is_none,
    "--ways": _is_any,
}
"""Options whose items used to be separate words, and tests for such items.

Each could be given more than once, too.
"""


def modernize(arguments: Sequence[str]) -> list[str]:
    """Return the arguments in the present spelling."""
    words = list(arguments)
    if len(words) >= 2 and (moved := MOVED.get(" ".join(words[:2]))):
        words[:2] = moved.split()
    command = next((k for k in (2, 1) if " ".join(words[:k]) in RENAMED), 0)
    renamed = RENAMED.get(" ".join(words[:command]), {})
    words = [_rename(word, renamed) for word in words]
    return _join_lists(words)


def _rename(word: str, renamed: dict[str, str]) -> str:
    option, equals, value = word.partition("=")
    return renamed.get(option, option) + equals + value


def _join_lists(words: list[str]) -> list[str]:
    """Join the items of each list to one word, with commas between them."""
    joined: list[str] = []
    places: dict[str, int] = {}
    index = 0
    while index < len(words):
        word = words[index]
        index += 1
        option, equals, value = word.partition("=")
        if option not in LISTS or (option == "--scenes" and words[0] != "bench"):
            joined.append(word)
            continue
        items = [value] if equals else _take_items(words[index:], LISTS[option])
        index += 0 if equals else len(items)
        if option in places:
            joined[places[option]] = ",".join([joined[places[option]], *items])
            continue
        joined.append(word)
        if not equals and (items or LISTS[option] is _is_any):
            joined.append(",".join(items))
        places[option] = len(joined) - 1
    return joined


def _take_items(words: list[str], is_item: Callable[[str], bool]) -> list[str]:
    """Remove and return the leading items; the first word is one unless it is an option."""
    items: list[str] = []
    for word in words:
        is_option = word.startswith("-") and not _is_number(word)
        if is_option or (items and ("," in items[0] or not is_item(word))):
            break
        items.append(word)
    return items
