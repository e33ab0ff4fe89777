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
from robots.storage.files import describe, read_bounded, write_atomically

STARTS_OVER = "without --resume it starts over"
RECIPE, PART, RESULT, CHECKSUM = "recipe", "part", "result", "sha256"
"""Keys of the lines."""
MOST_BYTES = 2**30


class Ledger:
    """The finished parts of some work by name, and the recipe on which they depend.

    Each part is one line of the file, added as it ends, and carries a checksum of itself and of all
    lines before it. A last line that is cut off, by a program that was killed, does not count.
    """

    def __init__(self, path: Path, recipe: object) -> None:
        """Begin an empty ledger; the file appears with the first part.

        Args:
            path: The file, which the first part replaces.
            recipe: What the results depend on, as a dataclass or a mapping.

        Raises:
            ValueError: if the file is a symbolic link, through which another would be written.
        """
        if path.is_symlink():
            raise ValueError(f"{path}: is a symbolic link, expected a file: name or remove it")
        self.path = path
        self.recipe: dict[str, Any] = as_kept(recipe)
        self.done: dict[str, Any] = {}
        """Results in the form of JSON, in the order in which they were added."""
        self._written = 0  # bytes of the file
        self._file = 0  # its inode
        self._digest = hashlib.sha256()

    @classmethod
    def resume(cls, path: Path, recipe: object) -> Ledger:
        """Open the ledger of a recipe; begin one if there is no file.

        Raises:
            ValueError: if the file is damaged, or that of another recipe.
        """
        ledger = cls(path, recipe)
        if path.exists():
            ledger._read()
        return ledger

    def add(self, name: str, result: object) -> Any:
        """Store the result of a part; return it as stored."""
        self.done[name] = as_kept(result)
        part = {PART: name, RESULT: self.done[name]}
        if self._written:
            self._append(self._seal(part))
        else:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = self._seal({RECIPE: self.recipe}) + self._seal(part)
            write_atomically(self.path, content)
            self._written, self._file = len(content), self.path.stat().st_ino
        return self.done[name]

    def _append(self, line: bytes) -> None:
        """Add a line in place of what follows the last whole one.

        Raises:
            ValueError: if another program has added lines meanwhile.
        """
        with self.path.open("r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.seek(self._written)
            if os.fstat(file.fileno()).st_ino != self._file or b"\n" in file.read():
                raise ValueError(
                    f"{self.path}: another program adds parts as well, expected one at a time: end "
                    "it, or use another file"
                )
            file.truncate(self._written)
            file.seek(self._written)
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        self._written += len(line)

    def _seal(self, content: Mapping[str, Any]) -> bytes:
        """Write a line with the checksum of all lines up to it."""
        self._digest.update(to_json_line(content))
        return to_json_line({**content, CHECKSUM: self._digest.hexdigest()})

    def _read(self) -> None:
        """Read the parts of the file.

        Raises:
            ValueError: if they are damaged, or of another recipe.
        """
        try:
            lines = _read_lines(self.path)
            rows = [_parse_line(line) for line in lines]
        except ValueError as error:
            raise ValueError(f"{self.path}: {error} ({STARTS_OVER})") from error
        if not isinstance(rows[0].get(RECIPE), dict):
            raise ValueError(f"{self.path}: keeps no work, expected a {RECIPE} ({STARTS_OVER})")
        if any(not isinstance(row.get(PART), str) or RESULT not in row for row in rows[1:]):
            raise ValueError(
                f"{self.path}: a line keeps no work, expected a {PART} and its {RESULT} "
                f"({STARTS_OVER})"
            )
        for line, row in zip(lines, rows, strict=True):
            row.pop(CHECKSUM, None)
            if self._seal(row) != line:
                raise ValueError(
                    f"{self.path}: its checksum differs, expected the parts as written "
                    f"({STARTS_OVER})"
                )
        check_recipe(self.path, self.recipe, rows[0][RECIPE], STARTS_OVER)
        self._written, self._file = sum(map(len, lines)), self.path.stat().st_ino
        self.done = {row[PART]: row[RESULT] for row in rows[1:]}


def _read_lines(path: Path) -> list[bytes]:
    """Read all lines but one that is cut off at the end; the only one is never left out.

    Raises:
        ValueError: if the file cannot be read.
    """
    try:
        content = read_bounded(path, MOST_BYTES)
    except OSError as error:
        raise ValueError(describe(error)) from error
    lines = content.splitlines(keepends=True) or [b""]
    return lines[:-1] if len(lines) > 1 and not lines[-1].endswith(b"\n") else lines


def _parse_line(line: bytes) -> dict[str, Any]:
    """Parse a line.

    Raises:
        ValueError: if it is no JSON object, or not written as a ledger writes it.
    """
    try:
        row = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"not JSON Lines ({' '.join(str(error).split())})") from error
    if not isinstance(row, dict):
        raise ValueError("not JSON Lines (a line is no object)")
    return row


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
