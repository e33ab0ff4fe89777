"""The plan cache: a folder of solved rises, with their starts.

A solved rise consists of two files in the subfolder of its robot: ``NAME.npz``, the motion, and
``NAME.json``, a `SolvedRise`, which is written last. A rise without it does not exist.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import re
import time
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.strategies.cache.solved_rise import SolvedRise, read_solved_rise
from robots.arguments import expect
from robots.storage.encoding import to_json
from robots.storage.files import read_bounded, write_atomically
from robots.storage.validation import parse_file

FOLDER_VARIABLE = "HUMANOID_GETUP_PLAN_CACHE"
"""Environment variable that names the folder of the cache."""
CAPACITY = 100  # rises of a robot; OP3's take 0.15 MB each
MAX_MOTION = 16 * 2**20  # bytes of a motion's file
NAME = re.compile(r"[0-9a-f]{16}")
SUFFIXES = (".json", ".npz")


class PlanCacheError(ValueError):
    """A file of the cache is damaged; the message names it and the reason."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CacheEntry:
    """A solved rise in a cache."""

    file: Path
    """Its ``NAME.json``."""
    rise: SolvedRise
    motion_sha256: str
    """Checksum of the motion's file."""

    @property
    def name(self) -> str:
        """Return the name of its files."""
        return self.file.stem

    @property
    def motion_file(self) -> Path:
        """Return the path of the motion."""
        return self.file.with_suffix(".npz")

    @property
    def size(self) -> int:
        """Return the size of both files [bytes]; a missing file has 0."""
        files = (self.file, self.motion_file)
        return sum(file.stat().st_size for file in files if file.is_file())

    def load_motion(self) -> Motion:
        """Load the motion.

        Raises:
            PlanCacheError: if it is missing, damaged, or not the one that was kept.
        """
        try:
            content = read_bounded(self.motion_file, MAX_MOTION)
            if hashlib.sha256(content).hexdigest() != self.motion_sha256:
                raise ValueError("its checksum differs from that in the entry")
            motion = Motion.load(self.motion_file)
        except OSError as error:
            raise PlanCacheError(f"plan cache {self.motion_file}: {error.strerror}") from error
        except ValueError as error:
            raise PlanCacheError(f"plan cache {self.motion_file}: {error}") from error
        for name, value, expected in (
            ("robot", motion.robot, self.rise.context.robot),
            ("number of joints", motion.joint_pos.shape[1], len(self.rise.joint_pos)),
        ):
            if value != expected:
                raise PlanCacheError(
                    f"plan cache {self.motion_file}: its {name} is {value!r}, expected "
                    f"{expected!r} as in the entry"
                )
        return motion


@dataclass(frozen=True)
class CacheContent:
    """The content of a cache."""

    entries: tuple[CacheEntry, ...]
    """Newest first."""
    problems: tuple[str, ...]
    """One line for each damaged entry."""


class PlanCache:
    """Solved rises in a folder, with one subfolder for each robot."""

    def __init__(self, folder: Path | str | None = None, *, capacity: int = CAPACITY) -> None:
        """Open a cache; the folder is created with the first rise.

        Args:
            folder: ``None`` for the user's own, see `default_folder`.
            capacity: Number of rises of each robot that are kept; the oldest go first.

        Raises:
            ValueError: if the capacity is below 1, or the folder is none.
        """
        expect("folder", folder, str | Path | None, "a folder, or None for the user's own")
        if capacity < 1:
            raise ValueError(f"capacity is {capacity}, expected 1 or more")
        self.folder = default_folder() if folder is None else Path(folder)
        self.capacity = capacity
        self._removed: set[Path] = set()

    def read(self, robot: str | None = None) -> CacheContent:
        """Read the entries of a robot, or all; their motions are not read.

        Raises:
            OSError: if the folder cannot be read.
        """
        entries, problems = [], []
        for file in self._list_files(robot):
            if file.suffix != ".json" or file in self._removed:
                continue
            try:
                entries.append(_read_entry(file))
            except FileNotFoundError:  # removed meanwhile
                continue
            except ValueError as error:
                problems.append(f"plan cache {file}: {error}")
        entries.sort(key=lambda entry: -entry.rise.made)
        return CacheContent(tuple(entries), tuple(problems))

    def list_robots(self) -> list[str]:
        """List the robots that have a subfolder."""
        folders = self.folder.iterdir() if self.folder.is_dir() else ()
        return sorted(folder.name for folder in folders if folder.is_dir())

    def find_problems(self, robot: str | None = None) -> list[str]:
        """Report every damaged entry, and every damaged motion.

        Raises:
            OSError: if the folder cannot be read.
        """
        content = self.read(robot)
        problems = list(content.problems)
        for entry in content.entries:
            try:
                entry.load_motion()
            except PlanCacheError as error:
                problems.append(str(error))
        return problems

    def keep(self, rise: SolvedRise, motion: Motion) -> CacheEntry:
        """Store a solved rise; one with the same start and context is replaced.

        Raises:
            OSError: if it cannot be written.
        """
        folder = self._subfolder(rise.context.robot)
        if folder.is_symlink():
            raise NotADirectoryError(errno.ENOTDIR, "it is a link, expected a folder", str(folder))
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{rise.name}.json"
        motion.save(file.with_suffix(".npz"))
        checksum = hashlib.sha256(file.with_suffix(".npz").read_bytes()).hexdigest()
        record = msgspec.to_builtins(rise, enc_hook=np.ndarray.tolist)
        write_atomically(file, to_json(record | {"motion_sha256": checksum}))
        self._removed.discard(file)
        self._drop_oldest(rise.context.robot)
        return CacheEntry(file=file, rise=rise, motion_sha256=checksum)

    def remove(self, entry: CacheEntry) -> None:
        """Remove an entry; one whose files cannot be removed is no longer read."""
        self._removed.add(entry.file)
        with contextlib.suppress(OSError):
            _remove(entry.file)

    def clear(self, robot: str | None = None) -> int:
        """Remove the rises of a robot, or all, damaged ones too; return how many there were.

        Raises:
            OSError: if some cannot be removed; all others are.
        """
        files = {file.with_suffix(".json") for file in self._list_files(robot)}
        failures = []
        for file in sorted(files):
            try:
                _remove(file)
            except OSError as error:
                failures.append(error)
        if failures:
            raise failures[0]
        return len(files)

    def _list_files(self, robot: str | None) -> list[Path]:
        """List the cache's own files; others in its folder, and linked folders, are left alone."""
        if not self.folder.exists():
            return []
        if not self.folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(self.folder))
        folders = sorted(self.folder.iterdir()) if robot is None else [self._subfolder(robot)]
        return [
            file
            for folder in folders
            if folder.is_dir() and not folder.is_symlink()
            for file in sorted(folder.iterdir())
            if file.suffix in SUFFIXES and NAME.fullmatch(file.stem)
        ]

    def _subfolder(self, robot: str) -> Path:
        return self.folder / re.sub(r"\W", "_", robot)

    def _drop_oldest(self, robot: str) -> None:
        """Remove the oldest rises beyond the capacity, by the times of their files."""
        written: dict[Path, float] = {}
        for file in self._list_files(robot):
            entry = file.with_suffix(".json")
            with contextlib.suppress(FileNotFoundError):  # removed meanwhile
                written[entry] = max(file.stat().st_mtime, written.get(entry, 0.0))
        by_age = sorted(written, key=lambda entry: -written[entry])
        for entry in by_age[self.capacity :]:
            _remove(entry)


def default_folder() -> Path:
    """Return the folder of the user's plan cache.

    It is what the variable `FOLDER_VARIABLE` names, or else lies in the user's cache folder, as
    the XDG Base Directory Specification has it.
    """
    if named := os.environ.get(FOLDER_VARIABLE):
        return Path(named)
    base = os.environ.get("XDG_CACHE_HOME", "")
    root = Path(base) if Path(base).is_absolute() else Path.home() / ".cache"
    return root / "humanoid-getup" / "plans"


def now() -> float:
    """Return the time [s since 1970]."""
    return time.time()


def _read_entry(file: Path) -> CacheEntry:
    record = parse_file(file, "JSON", json.loads)
    if not isinstance(record, dict):
        raise ValueError("not a JSON object")
    rise, checksum = read_solved_rise(record), record.get("motion_sha256")
    if not isinstance(checksum, str):
        raise ValueError("motion_sha256 is missing, expected a text")
    return CacheEntry(file=file, rise=rise, motion_sha256=checksum)


def _remove(file: Path) -> None:
    """Remove an entry's files, first the one that makes it an entry."""
    for suffix in SUFFIXES:
        one = file.with_suffix(suffix)
        if one.is_dir() and not one.is_symlink():
            one.rmdir()
        else:
            one.unlink(missing_ok=True)
