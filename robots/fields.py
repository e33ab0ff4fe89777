"""The fields of a TOML table, read with every fault they have."""

from collections.abc import Iterable
from typing import Any, TypeGuard

from robots.faults import is_number, shown


class Fields:
    """Reads a table; a field that is missing or wrong adds a fault and reads as a blank.

    So one pass finds all that is wrong. What was read is used only if there is no fault.
    """

    def __init__(self, table: dict[str, Any], owner: str, faults: list[str]) -> None:
        """Read ``table``, whose faults begin with ``owner`` and are added to ``faults``."""
        self._table, self._owner, self._faults = table, owner, faults

    def text(self, key: str) -> str:
        """Read a text; the blank is ''."""
        value = self._table.get(key)
        if _is_text(value):
            return value
        self._refuse(key, "a text")
        return ""

    def texts(self, key: str) -> tuple[str, ...]:
        """Read a list of different texts, at least one; the blank is ()."""
        value = self._table.get(key)
        if isinstance(value, list) and value and all(map(_is_text, value)):
            if len(set(value)) == len(value):
                return tuple(value)
            self._refuse(key, "each name once")
        else:
            self._refuse(key, "a list of texts, at least one")
        return ()

    def number(self, key: str, upper: float, unit: str) -> float:
        """Read a number above 0, at most ``upper``; the blank is nan."""
        value = self._table.get(key)
        if is_number(value) and 0.0 < value <= upper:
            return float(value)
        self._refuse(key, f"above 0 {unit}, at most {upper:g} {unit}", unit)
        return float("nan")

    def integer(self, key: str, lower: int, upper: int) -> int:
        """Read an integer in [lower, upper]; the blank is -1."""
        value = self._table.get(key)
        if isinstance(value, int) and not isinstance(value, bool) and lower <= value <= upper:
            return value
        self._refuse(key, f"an integer from {lower} to {upper}")
        return -1

    def sign(self, key: str) -> int:
        """Read -1 or 1; the blank is 0."""
        value = self._table.get(key)
        if is_number(value) and value in (-1, 1):
            return int(value)
        self._refuse(key, "-1 or 1")
        return 0

    def choice(self, key: str, allowed: Iterable[str]) -> str:
        """Read one of a few texts; the blank is ''."""
        value, allowed = self._table.get(key), list(allowed)
        if isinstance(value, str) and value in allowed:
            return value
        self._refuse(key, ", ".join(allowed))
        return ""

    def _refuse(self, key: str, allowed: str, unit: str = "") -> None:
        value = self._table.get(key)
        told = f"is {shown(value)} {unit if is_number(value) else ''}".rstrip()
        if key not in self._table:
            told = "is missing"
        self._faults.append(f"{self._owner}{key} {told}, allowed {allowed}")


def _is_text(value: Any) -> TypeGuard[str]:
    return isinstance(value, str) and bool(value.strip()) and value.isprintable()
