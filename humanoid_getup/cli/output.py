"""Where results go: checked before the work, written after it, complete or not at all."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from humanoid_getup.cli.errors import BadInputError

REPORT, MOTION, STRIP, TORQUE = "report.json", "motion.npz", "strip.png", "torque.png"
STYLE = "style.png"
ARTEFACTS = (MOTION, STRIP, TORQUE, STYLE, REPORT)
STANDARD_OUTPUT = "-"
SCRATCH = ".getup-"
SMALL_FIGURE = 0.1  # below which two decimals are too few
ROUNDING = 1e-9  # below which a figure is 0
WIDTH = 120  # characters of a line that goes to no terminal


class PipeConsole(Console):
    """A console that leaves a closed pipe to `main`; rich would exit with code 1."""

    def on_broken_pipe(self) -> None:
        """Raise the `BrokenPipeError` again."""
        raise


def console_for(json: str | None) -> Console:
    """Return the console for people: standard error where JSON takes standard output."""
    console = PipeConsole(stderr=json == STANDARD_OUTPUT, highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    return console


@contextmanager
def phase(text: str) -> Iterator[Callable[[str], None]]:
    """Show what a command is doing on standard error; yield what changes the text."""
    with Console(stderr=True).status(text) as status:
        yield status.update


def find_folder_faults(
    folder: Path, names: tuple[str, ...] = ARTEFACTS, owner: str | None = None
) -> list[str]:
    """Report why files could not be written into a folder, by trying; leave nothing behind.

    ``owner`` is what the messages call the folder.
    """
    owner = owner or f"output folder {folder}"
    try:
        existing = _find_existing(folder)
        if not existing.is_dir():
            return [f"{owner}: {existing} is not a folder, expected a folder that can be written"]
        with tempfile.TemporaryDirectory(dir=existing, prefix=SCRATCH) as scratch:
            missing = _absolute(folder).relative_to(existing)
            Path(scratch, missing).mkdir(parents=True, exist_ok=True)
        in_the_way = [folder / name for name in names if (folder / name).is_dir()]
    except OSError as error:
        return [f"{owner}: {error.strerror}, expected a folder that can be written"]
    return [f"output file {path}: is a folder, expected a file" for path in in_the_way]


def find_file_faults(file: Path) -> list[str]:
    """Report why a file could not be written."""
    if not file.name:
        return [f"output file '{file}': expected the name of a file"]
    target = _absolute(file)
    try:
        target = target.resolve() if target.is_symlink() else target
        if target.exists() and not target.is_file() and not target.is_dir():  # a device, a FIFO
            writable = os.access(target, os.W_OK)
            return [] if writable else [f"output file {file}: Permission denied"]
    except (OSError, RuntimeError) as error:  # a name too long, links in a circle
        return [f"output file {file}: {getattr(error, 'strerror', error)}"]
    if target.is_dir():
        return [f"output file {file}: is a folder, expected a file"]
    return find_folder_faults(file.parent if target == _absolute(file) else target.parent, ())


def find_json_faults(json: str | None) -> list[str]:
    """Report why JSON could not be written."""
    return [] if json in (None, STANDARD_OUTPUT) else find_file_faults(Path(json))


@contextmanager
def staging(folder: Path, names: tuple[str, ...] = ARTEFACTS) -> Iterator[Path]:
    """Yield an empty folder; move what was written there into ``folder`` at the end.

    A file of ``names`` that was not written is removed: it was an earlier run's.
    """
    from robots.files import atomic_path

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
        raise BadInputError(f"output folder {folder}: {error.strerror}") from error


def write_json(text: str, json: str | None) -> None:
    """Write JSON to a file, to standard output, or nowhere."""
    if json == STANDARD_OUTPUT:
        sys.stdout.write(text)
    elif json is not None:
        from robots.files import write_atomically

        try:
            Path(json).parent.mkdir(parents=True, exist_ok=True)
            write_atomically(Path(json), text)
        except OSError as error:
            raise BadInputError(f"output file {json}: {error.strerror}") from error


def _absolute(path: Path) -> Path:
    return Path(os.path.abspath(path))  # noqa: PTH100  (resolve would follow links)


def _find_existing(path: Path) -> Path:
    """Return a path, or the part of it that exists."""
    path = _absolute(path)
    while not os.path.lexists(path):
        path = path.parent
    return path


@contextmanager
def counting(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on standard error; yield what advances it."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    name = TextColumn("{task.description}", markup=False)  # it may hold the name of a file
    columns = (name, BarColumn(), MofNCompleteColumn())
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, *times, console=Console(stderr=True)) as progress:
        bar = progress.add_task(what, total=total)
        yield lambda done: progress.advance(bar, done)


def make_table(headings: Sequence[str], *, left: Sequence[str]) -> Table:
    """Make a table of numbers, to the right, and of the texts under the headings in ``left``."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in headings:
        table.add_column(heading, justify="left" if heading in left else "right")
    return table


def format_figure(value: Any) -> str:
    """Write a figure, an interval, counts, or a median with its 95th percentile, for people."""
    if isinstance(value, dict) and "median" not in value:
        return ", ".join(f"{count} {name}" for name, count in value.items())
    if isinstance(value, dict):
        return f"{format_figure(value['median'])} (p95 {format_figure(value['p95'])})"
    if isinstance(value, list | tuple):
        return " to ".join(map(format_figure, value))
    if not isinstance(value, float):
        return str(value)
    is_small = ROUNDING < abs(value) < SMALL_FIGURE
    return f"{value:.2g}" if is_small else f"{value:.2f}"


def to_json(record: Any) -> str:
    """Write a record as JSON text; numbers that are not finite become null."""
    return json.dumps(_plain(record), indent=1, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
