"""Checks of the types of arguments of library functions."""

from __future__ import annotations

from types import UnionType
from typing import Any

import numpy as np

from robots.storage.validation import shown

PLAIN = (str, int, float, bytes, list, tuple, dict, set, type, type(None))
"""Types of values that a message shows; of others it names the type."""


def expect(name: str, value: object, kind: type | UnionType | tuple[Any, ...], what: str) -> None:
    """Check the type of an argument; a bool is not accepted as a number.

    Args:
        name: Name of the argument.
        value: Its value.
        kind: Expected type or types.
        what: Description of what is expected, such as "a Robot, e.g. load_robot('op3')".

    Raises:
        ValueError: if the value is of another type.
    """
    if isinstance(value, kind) and not isinstance(value, bool):
        return
    raise ValueError(f"{name} is {_describe(value)}, expected {what}")


def expect_seed(seed: Any) -> None:
    """Check a seed of random numbers.

    Raises:
        ValueError: if it is not a whole number from 0.
    """
    what = "a whole number from 0"
    expect("seed", seed, int | np.integer, what)
    if seed < 0:
        raise ValueError(f"seed is {seed}, expected {what}")


def _describe(value: object) -> str:
    if isinstance(value, PLAIN):
        return " ".join(shown(value).split())
    return f"a {type(value).__name__}"
