"""Where a command's results go: checked before the work, written after it, whole or not at all."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from humanoid_getup.commands.errors import BadInputError

REPORT, MOTION, STRIP, TORQUE = "report.json", "motion.npz", "strip.png", "torque.png"
ARTEFACTS = (MOTION, STRIP, TORQUE, REPORT)
STANDARD_OUTPUT = "-"
SCRATCH = ".getup-"
WIDTH = 120  # characters of a line that goes to no terminal


def console_for(json: str | None) -> Console:
    """Return where words for people go: not among the JSON."""
    console = Console(stderr=json == STANDARD_OUTPUT, highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    return console


def find_folder_faults(folder: Path, names: tuple[str, ...] = ARTEFACTS) -> list[str]:
    """Tell why files could not be written into a folder, by trying; leave nothing behind."""
    told = f"output folder {folder}"
    try:
        ground = _nearest(folder)
        if not ground.is_dir():
            return [f"{told}: {ground} is not a folder, allowed a folder that can be written"]
        with tempfile.TemporaryDirectory(dir=ground, prefix=SCRATCH) as scratch:
            missing = _absolute(folder).relative_to(ground)
            Path(scratch, missing).mkdir(parents=True, exist_ok=True)
        in_the_way = [folder / name for name in names if (folder / name).is_dir()]
    except OSError as error:
        return [f"{told}: {error.strerror}, allowed a folder that can be written"]
    return [f"output file {path}: is a folder, allowed a file" for path in in_the_way]


def find_file_faults(file: Path) -> list[str]:
    """Tell why a file could not be written."""
    if not file.name:
        return [f"output file '{file}': allowed the name of a file"]
    return find_folder_faults(file.parent, (file.name,))


def find_json_faults(json: str | None) -> list[str]:
    """Tell why JSON could not be written."""
    return [] if json in (None, STANDARD_OUTPUT) else find_file_faults(Path(json))


@contextmanager
def staging(folder: Path, names: tuple[str, ...] = ARTEFACTS) -> Iterator[Path]:
    """Yield an empty folder; move what was written there into ``folder`` at the end.

    A file of ``names`` that was not written anew is removed: it was an earlier run's.
    """
    try:
        with tempfile.TemporaryDirectory(dir=_nearest(folder), prefix=SCRATCH) as scratch:
            yield Path(scratch)
            folder.mkdir(parents=True, exist_ok=True)
            for name in names:
                if Path(scratch, name).exists():
                    Path(scratch, name).replace(folder / name)
                else:
                    (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise BadInputError(f"output folder {folder}: {error.strerror}") from error


def write_json(text: str, json: str | None) -> None:
    """Write JSON to a file, to standard output, or nowhere."""
    if json == STANDARD_OUTPUT:
        sys.stdout.write(text)
    elif json is not None:
        path = Path(json)
        with staging(path.parent, (path.name,)) as scratch:
            (scratch / path.name).write_text(text, "utf-8")


def _absolute(path: Path) -> Path:
    return Path(os.path.abspath(path))  # noqa: PTH100  (resolve would follow links)


def _nearest(path: Path) -> Path:
    """Return a path, or what exists of it."""
    path = _absolute(path)
    while not os.path.lexists(path):
        path = path.parent
    return path
