"""Output files: checked before the work, written after it, complete or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError

SCRATCH = ".getup-"


def find_folder_problems(folder: Path, names: Sequence[str]) -> list[str]:
    """Report why files could not be written into a folder, by a trial that leaves nothing."""
    owner = f"output folder {folder}"
    try:
        existing = _find_existing(folder)
        if not existing.is_dir():
            return [f"{owner}: {existing} is not a folder, expected a folder that can be written"]
        with tempfile.TemporaryDirectory(dir=existing, prefix=SCRATCH) as scratch:
            missing = make_absolute(folder).relative_to(existing)
            Path(scratch, missing).mkdir(parents=True, exist_ok=True)
            Path(scratch, missing, SCRATCH).write_bytes(bytes(4096))  # a full disk has no room
        in_the_way = [folder / name for name in names if (folder / name).is_dir()]
    except OSError as error:
        return [f"{owner}: {error.strerror}, expected a folder that can be written"]
    return [f"output file {path}: is a folder, expected a file" for path in in_the_way]


def find_file_problems(file: Path) -> list[str]:
    """Report why a file could not be written."""
    if not file.name:
        return [f"output file '{file}': expected the name of a file"]
    target = make_absolute(file)
    try:
        target = target.resolve() if target.is_symlink() else target
        if file.exists() and not file.is_file() and not file.is_dir():  # a device, a FIFO
            if not os.access(file, os.W_OK):
                return [f"output file {file}: Permission denied"]
            if file.is_char_device():
                with file.open("wb", buffering=0) as device:
                    device.write(b"")  # which /dev/full refuses
            return []
    except (OSError, RuntimeError) as error:  # a name too long, links in a circle
        return [f"output file {file}: {getattr(error, 'strerror', error)}"]
    if target.is_dir():
        return [f"output file {file}: is a folder, expected a file"]
    return find_folder_problems(file.parent if target == make_absolute(file) else target.parent, ())


def check_file(file: Path) -> None:
    """Refuse a file that could not be written."""
    if problems := find_file_problems(file):
        raise BadInputError(*problems)


def find_new_folder_problems(folder: Path, option: str) -> list[str]:
    """Report a folder that exists already, with something in it."""
    try:
        if folder.is_dir() and any(folder.iterdir()):
            return [f"{option} is {folder}, which is not empty, expected a new folder"]
        if folder.is_symlink():
            return [f"{option} is {folder}, which is a symbolic link, expected a new folder"]
    except OSError as error:
        return [f"{option} is {folder}: {error.strerror}, expected a new folder"]
    return []


@contextmanager
def staging(folder: Path, names: Sequence[str]) -> Iterator[Path]:
    """Yield an empty folder; move its files into ``folder`` at the end.

    A file of ``names`` that was not written is removed: it was an earlier run's.
    """
    from robots.storage.files import atomic_path

    try:
        with tempfile.TemporaryDirectory(dir=_find_existing(folder), prefix=SCRATCH) as scratch:
            yield Path(scratch)
            folder.mkdir(parents=True, exist_ok=True)
            for name in names:
                if Path(scratch, name).exists():
                    with atomic_path(folder / name) as partial:
                        shutil.move(Path(scratch, name), partial)
                elif (folder / name).is_file():
                    (folder / name).unlink()
    except OSError as error:
        name = Path(str(error.filename)).name
        place = f"file {folder / name}" if name in names else f"folder {folder}"
        raise BadInputError(f"output {place}: {error.strerror}") from error


def make_absolute(path: Path) -> Path:
    """Return an absolute path whose links are not followed."""
    return Path(os.path.abspath(path))  # noqa: PTH100  (resolve would follow links)


def _find_existing(path: Path) -> Path:
    """Return the existing part of a path."""
    path = make_absolute(path)
    while not os.path.lexists(path):
        path = path.parent
    return path
