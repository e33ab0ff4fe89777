"""A loop of checks over nothing checks nothing."""

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def nonempty(items: Iterable[T]) -> list[T]:
    """Return the items of a loop whose body asserts; there must be some."""
    found = list(items)
    assert found, "nothing to check"
    return found
