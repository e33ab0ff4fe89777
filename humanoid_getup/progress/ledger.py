"""The ledger of long work: a file of finished pieces, from which interrupted work resumes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robots.storage.encoding import as_kept, to_json
from robots.storage.files import write_atomically
from robots.storage.validation import parse_file

STARTS_OVER = "without --resume it starts over"


class Ledger:
    """The finished parts of some work by name, and the recipe on which they depend."""

    def __init__(self, path: Path, recipe: object) -> None:
        """Begin an empty ledger; the file appears with the first part.

        Args:
            path: The file; a part that is added replaces it.
            recipe: What the results depend on, as a dataclass or a mapping.
        """
        self.path = path
        self.recipe: dict[str, Any] = as_kept(recipe)
        self.done: dict[str, Any] = {}
        """Results in the form of JSON, in the order in which they were added."""

    @classmethod
    def resume(cls, path: Path, recipe: object) -> Ledger:
        """Open the ledger of a recipe; begin one if there is no file.

        Raises:
            ValueError: if the file is damaged, or that of another recipe.
        """
        ledger = cls(path, recipe)
        if path.exists():
            ledger.done = _load(path, ledger.recipe)
        return ledger

    def add(self, name: str, result: object) -> Any:
        """Store the result of a part; return it as stored."""
        self.done[name] = as_kept(result)
        content = {"recipe": self.recipe, "sha256": _hash(self.done), "done": self.done}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(self.path, to_json(content))
        return self.done[name]


def _load(path: Path, recipe: Mapping[str, Any]) -> dict[str, Any]:
    """Load the parts of a ledger.

    Raises:
        ValueError: if they are damaged, or of another recipe.
    """
    try:
        content = parse_file(path, "JSON", json.loads)
    except ValueError as error:
        raise ValueError(f"{path}: {error} ({STARTS_OVER})") from error
    if not isinstance(content, dict) or not isinstance(content.get("recipe"), dict):
        raise ValueError(f"{path}: keeps no work, expected the key recipe ({STARTS_OVER})")
    if not isinstance(done := content.get("done"), dict) or content.get("sha256") != _hash(done):
        raise ValueError(
            f"{path}: its checksum differs, expected the parts as written ({STARTS_OVER})"
        )
    check_recipe(path, recipe, content["recipe"], STARTS_OVER)
    return done


def check_recipe(
    path: Path, recipe: Mapping[str, Any], kept: Mapping[str, Any], remedy: str
) -> None:
    """Compare the recipe of work with the one stored in a file.

    Raises:
        ValueError: naming what differs; ``remedy`` says what to do.
    """
    if keys := [key for key in {**recipe, **kept} if recipe.get(key) != kept.get(key)]:
        listed = ", ".join(_compare(key, recipe.get(key), kept.get(key)) for key in keys)
        raise ValueError(f"{path}: made with another {listed}, expected the same ({remedy})")


def _compare(key: str, now: Any, before: Any) -> str:
    """List the differences of recipes, with values except for checksums."""
    is_long = any(len(str(value)) >= 32 for value in (now, before))
    return key if is_long else f"{key} ({before}, now {now})"


def _hash(done: Mapping[str, Any]) -> str:
    return hashlib.sha256(to_json(done).encode()).hexdigest()
