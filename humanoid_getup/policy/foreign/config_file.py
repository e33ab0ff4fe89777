"""Configuration files of other projects as plain values: no code in them is run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from humanoid_getup.policy.foreign.description import ForeignPolicyError
from robots.storage.validation import parse_file
from robots.storage.yaml_text import parse_yaml

LARGEST = sys.float_info.max
T = TypeVar("T")


def load_config(file: Path, language: str, parse: Callable[[str], T]) -> T:
    """Read and parse a configuration file.

    Raises:
        ForeignPolicyError: if it cannot be read or parsed, naming the file.
    """
    try:
        return parse_file(file, language, parse)
    except ForeignPolicyError:
        raise
    except ValueError as error:
        raise ForeignPolicyError(f"{file}: {error}") from error


def load_yaml(file: Path) -> dict[str, Any]:
    """Read a YAML file; tags of Python objects become the lists or tables that they tag.

    Raises:
        ForeignPolicyError: if it cannot be read, is not YAML, or holds no table.
    """
    found = load_config(file, "YAML", partial(parse_yaml, keeps_tagged=True))
    if not isinstance(found, dict):
        raise ForeignPolicyError(f"{file} holds no table, expected a deploy.yaml or an env.yaml")
    return found


def is_number(value: Any) -> bool:
    """Return whether a value is a number that fits into a float."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


class ConfigTable:
    """A table within a configuration file, which names itself in messages and sources."""

    def __init__(self, values: Mapping[str, Any], file: str, place: str = "") -> None:
        """Wrap a table; the place is that of the table in the file."""
        self.values, self.file, self._place = values, file, place

    def name(self, key: str) -> str:
        """Name a value for people: the file and the path of its keys."""
        return f"{self.file} {self._path(key)}"

    def table(self, key: str) -> ConfigTable:
        """Return a table in this one.

        Raises:
            ForeignPolicyError: if there is none.
        """
        found = self.require(key)
        if not isinstance(found, Mapping):
            raise ForeignPolicyError(f"{self.name(key)} is {found!r:.40}, expected a table")
        return ConfigTable(found, self.file, self._path(key))

    def require(self, key: str) -> Any:
        """Return a value.

        Raises:
            ForeignPolicyError: if it is missing.
        """
        if key not in self.values:
            raise ForeignPolicyError(f"{self.name(key)} is missing")
        return self.values[key]

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value, or a default if it is missing or null."""
        found = self.values.get(key)
        return default if found is None else found

    def number(self, key: str) -> float:
        """Return a number.

        Raises:
            ForeignPolicyError: if it is missing or no number.
        """
        found = self.require(key)
        if not is_number(found):
            raise ForeignPolicyError(f"{self.name(key)} is {found!r:.40}, expected a number")
        return float(found)

    def texts(self, key: str, default: Any = None) -> tuple[str, ...]:
        """Return a list of texts, or one of them.

        Raises:
            ForeignPolicyError: if it is neither.
        """
        found = self.get(key, default)
        texts = [found] if isinstance(found, str) else found
        if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
            raise ForeignPolicyError(f"{self.name(key)} is {found!r:.40}, expected texts")
        return tuple(texts)

    def positive(self, key: str) -> float:
        """Return a number above 0.

        Raises:
            ForeignPolicyError: if it is missing or not one.
        """
        found = self.number(key)
        if not 0.0 < found < 1e6:
            raise ForeignPolicyError(f"{self.name(key)} is {found:g}, expected above 0")
        return found

    def _path(self, key: str) -> str:
        return f"{self._place}.{key}" if self._place else key
