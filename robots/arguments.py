"""Checks of the types of arguments of library functions."""

from __future__ import annotations

from types import UnionType
from typing import Any

import numpy as np

from robots.storage.validation import shown

PLAIN = (str, int, float, bytes, list, tuple, dict, set, type, type(None))
"""Types of values that a message shows; of others it names the type."""


def expect(name: str, value: object, kind: type | UnionType | tuple[Any, ...], what: str) -> None:
    """Raise ValueError if an argument is of another type; a bool is not accepted as a number.

    ``what`` says what is expected, such as "a Robot, e.g. load_robot('op3')".
    """
    if isinstance(value, kind) and not isinstance(value, bool):
        return
    is_plain = isinstance(value, PLAIN)
    found = " ".join(shown(value).split()) if is_plain else f"a {type(value).__name__}"
    raise ValueError(f"{name} is {found}, expected {what}")


def expect_seed(seed: Any) -> None:
    """Raise ValueError if a seed of random numbers is not a whole number from 0."""
    what = "a whole number from 0"
    expect("seed", seed, int | np.integer, what)
    if seed < 0:
        raise ValueError(f"seed is {seed}, expected {what}")
