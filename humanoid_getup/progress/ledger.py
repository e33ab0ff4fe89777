"""The ledger of long work: a file of finished pieces, from which interrupted work resumes."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robots.storage.encoding import as_kept, to_json_line
from robots.storage.files import read_bounded, write_atomically
from robots.storage.validation import reading

STARTS_OVER = "without --resume it starts over"
RECIPE, PART, RESULT, CHECKSUM = "recipe", "part", "result", "sha256"
"""Keys of the lines."""
HEAD = f'{{"{RECIPE}":'.encode()  # first bytes of the file
MOST_BYTES = 2**30


class Ledger:
    """The finished parts of some work by name, and the recipe on which they depend.

    Each part is one line of the file, added as it ends, and carries a checksum of itself and of all
    lines before it. A last line that is cut off, by a program that was killed, does not count.
    """

    def __init__(self, path: Path, recipe: object) -> None:
        """Begin an empty ledger; the file is replaced with the first part.

        Args:
            path: The file.
            recipe: What the results depend on, as a dataclass or a mapping.
        """
        if path.is_symlink():
            raise ValueError(f"{path}: is a symbolic link, expected a file: name or remove it")
        if path.is_file() and not _may_be_ledger(path):
            raise ValueError(f"{path}: is no ledger, expected one or a new file")
        self.path = path
        self.recipe: dict[str, Any] = as_kept(recipe)
        self.done: dict[str, Any] = {}
        """Results in the form of JSON, in the order in which they were added."""
        self._size, self._file = 0, 0  # bytes and inode
        self._digest = hashlib.sha256()

    @classmethod
    def resume(cls, path: Path, recipe: object) -> Ledger:
        """Open the ledger of a recipe; begin one if there is no file."""
        ledger = cls(path, recipe)
        if path.exists():
            ledger._read()
        return ledger

    def add(self, name: str, result: object) -> Any:
        """Store the result of a part; return it as stored."""
        self.done[name] = as_kept(result)
        part = {PART: name, RESULT: self.done[name]}
        if self._size:
            self._append(self._seal(part))
        else:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = self._seal({RECIPE: self.recipe}) + self._seal(part)
            write_atomically(self.path, content)
            self._size, self._file = len(content), self.path.stat().st_ino
        return self.done[name]

    def _append(self, line: bytes) -> None:
        """Add a line in place of what follows the last whole one."""
        with self.path.open("r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.seek(self._size)
            if os.fstat(file.fileno()).st_ino != self._file or b"\n" in file.read():
                raise ValueError(
                    f"{self.path}: another program adds parts as well, expected one at a time: end "
                    "it, or use another file"
                )
            file.truncate(self._size)
            file.seek(self._size)
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        self._size += len(line)

    def _seal(self, content: Mapping[str, Any]) -> bytes:
        """Write a line with the checksum of all lines up to it."""
        self._digest.update(to_json_line(content))
        return to_json_line({**content, CHECKSUM: self._digest.hexdigest()})

    def _read(self) -> None:
        """Read the parts of the file."""
        with reading(str(self.path), advice=f" ({STARTS_OVER})"):
            lines = read_bounded(self.path, MOST_BYTES).splitlines(keepends=True)
        if len(lines) > 1 and not lines[-1].endswith(b"\n"):
            lines.pop()
        try:
            head, *rows = map(self._open, lines)
            self.done = {row[PART]: row[RESULT] for row in rows}
            recipe = dict(head[RECIPE])
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            problem = "not JSON" if isinstance(error, json.JSONDecodeError) else "it is damaged"
            raise ValueError(
                f"{self.path}: {problem}, expected a recipe and parts as they were written "
                f"({STARTS_OVER})"
            ) from error
        check_recipe(self.path, self.recipe, recipe, STARTS_OVER)
        self._size, self._file = sum(map(len, lines)), self.path.stat().st_ino

    def _open(self, line: bytes) -> dict[str, Any]:
        """Parse a line whose checksum is right."""
        row = json.loads(line)
        del row[CHECKSUM]
        if self._seal(row) != line:
            raise ValueError("another checksum")
        return row


def check_recipe(
    path: Path, recipe: Mapping[str, Any], kept: Mapping[str, Any], remedy: str
) -> None:
    """Compare the recipe of work with the one stored in a file."""
    differing = list[str]()
    for key in {**recipe, **kept}:
        now, before = recipe.get(key), kept.get(key)
        if now != before:
            is_long = max(len(str(now)), len(str(before))) >= 32
            differing.append(key if is_long else f"{key} ({before}, now {now})")
    if differing:
        raise ValueError(
            f"{path}: made with another {', '.join(differing)}, expected the same ({remedy})"
        )


def _may_be_ledger(path: Path) -> bool:
    """Return whether a file begins as a ledger does, or is empty or cut off there."""
    with path.open("rb") as file:
        return HEAD.startswith(file.read(len(HEAD)))
