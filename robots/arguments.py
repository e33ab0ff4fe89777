"""Arguments of library functions: those of another type are refused at the entrance."""

from __future__ import annotations

from types import UnionType
from typing import Any

import numpy as np

from robots.storage.validation import shown

PLAIN = (str, int, float, bytes, list, tuple, dict, set, type, type(None))
"""Types of values that a message shows; of others it names the type."""


def expect(name: str, value: object, kind: type | UnionType | tuple[Any, ...], what: str) -> None:
    """Refuse an argument of another type; true and false are no numbers.

    Args:
        name: Of the argument.
        value: That was given.
        kind: Its type, or several.
        what: Is expected, such as "a Robot, e.g. load_robot('op3')".

    Raises:
        ValueError: naming all of them.
    """
    if isinstance(value, kind) and not isinstance(value, bool):
        return
    raise ValueError(f"{name} is {_describe(value)}, expected {what}")


def expect_seed(seed: object) -> None:
    """Refuse what seeds no random numbers.

    Raises:
        ValueError: naming it.
    """
    what = "a whole number from 0"
    expect("seed", seed, int | np.integer, what)
    if seed < 0:  # type: ignore[operator]
        raise ValueError(f"seed is {seed}, expected {what}")


def _describe(value: object) -> str:
    if isinstance(value, PLAIN):
        return " ".join(shown(value).split())
    return f"a {type(value).__name__}"
