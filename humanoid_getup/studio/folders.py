"""Folders: the only places in which the page reads and writes files."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError
from robots.storage.files import read_bounded

MOST_FILES, MOST_VISITED = 200, 10_000
"""Number of files of a kind that the page lists, and of files that it looks at for them."""
LARGE = 2**20  # bytes


class Folders:
    """Folders that were named when the studio was started."""

    def __init__(self, folders: Sequence[Path]) -> None:
        """Prepare; relative names of files are below the first folder."""
        self._roots = tuple(folder.resolve() for folder in folders)

    def resolve(self, name: str) -> Path:
        """Return the path of a file by its name, relative to the first folder or absolute."""
        if not name.strip():
            raise BadInputError("the file has no name, expected one")
        try:
            path = (self._roots[0] / name.strip()).resolve()
        except (OSError, RuntimeError, ValueError) as error:
            raise BadInputError(f"file {name!r}: {error}") from error
        if not self._contains(path):
            raise BadInputError(f"file {path}: expected a file in {self._list()} (see --folder)")
        return path

    def resolve_new(self, kind: str, name: str, suffix: str) -> Path:
        """Return the path of a file of some kind to write, whose name ends with a suffix."""
        path = self.resolve(name)
        if path.suffix != suffix:
            raise BadInputError(f"{kind} {path.name}: expected a name that ends with {suffix}")
        return path

    def resolve_folder(self, name: str, files: Iterable[str]) -> Path:
        """Return the path of a folder in which files are written, each of them by its name."""
        folder = self.resolve(name)
        for file in files:
            self.resolve(str(folder / file))
        return folder

    def list_files(
        self, suffix: str, accepts: Callable[[Path], bool] = lambda _: True
    ) -> list[str]:
        """List the files with a suffix, newest first, by names that `resolve` takes.

        Files that are not accepted, hidden folders, and all that comes after some ten thousand
        files, are left out.
        """
        found = islice((path for root in self._roots for path in _walk(root)), MOST_VISITED)
        files = [path for path in found if path.suffix == suffix and self._holds(path)]
        files.sort(key=lambda path: -path.stat().st_mtime)
        return list(dict.fromkeys(map(self.name, islice(filter(accepts, files), MOST_FILES))))

    def _holds(self, path: Path) -> bool:
        """Return whether a path leads to a file within the folders."""
        target = path.resolve()
        return target.is_file() and self._contains(target)

    def _contains(self, path: Path) -> bool:
        return any(path.is_relative_to(root) for root in self._roots)

    def _list(self) -> str:
        return ", ".join(map(str, self._roots))

    def name(self, path: Path) -> str:
        """Return the name of a file within the folders."""
        first = self._roots[0]
        return str(path.relative_to(first) if path.is_relative_to(first) else path)


def containing(pattern: re.Pattern[bytes]) -> Callable[[Path], bool]:
    """Make a function that accepts files which are not large, with a pattern in them."""

    def accepts(path: Path) -> bool:
        try:
            return pattern.search(read_bounded(path, LARGE)) is not None
        except (OSError, ValueError):
            return False

    return accepts


def _walk(root: Path) -> Iterator[Path]:
    for folder, below, files in os.walk(root):
        below[:] = sorted(name for name in below if not name.startswith("."))
        yield from (Path(folder, name) for name in files)
