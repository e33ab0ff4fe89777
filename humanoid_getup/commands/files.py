"""Files that a request reads and writes: none may be both.

Output files are checked before the work, and written after it, complete or not at all.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.values import list_notes, name_option
from robots.storage.validation import hints_of

STANDARD_OUTPUT = "-"
SCRATCH = ".getup-"
ROBOT_FILES = (
    *("robot.toml", "servos.toml", "keyframes.toml"),
    *("calibration.toml", "calibration.virtual.toml", "identified.toml"),
)
ROBOT_SUFFIXES = (".xml", ".stl", ".obj", ".msh")
MADE_FOLDERS, MADE_SUFFIXES = ("motions", "policies", "unfinished"), (".npz", ".onnx", ".toml")


@dataclass(frozen=True)
class Read:
    """Marks a field in `Annotated` that names one or several files to read."""

    robot: bool = False
    """Whether it names a robot, or its folder."""


@dataclass(frozen=True)
class Written:
    """Marks a field in `Annotated` that names a file or folder to write."""

    names: tuple[str, ...] | None = None
    """Names of the files in the folder; ``None`` for a field that is a file."""
    made: bool = False
    """Whether it is a motion or policy, which may replace an earlier one of the robot."""
    suffix: str = ""
    """Ending of the name, if it needs one."""


READ, ROBOT = Read(), Read(robot=True)
WRITTEN, FOLDER, MADE = Written(), Written(()), Written(made=True)
PICTURE = Written(suffix=".png")


def find_output_problems(request: Any) -> list[str]:
    """Report outputs that cannot be written, are inputs as well, or are the same file."""
    problems, endings, owners, folders = [], [], dict[Path, str](), dict[Path, str]()
    for option, value, mark in _list_marked(request, Written):
        path = Path(value)
        if mark.names is None:
            problems += find_file_problems(path)
        else:
            problems += find_folder_problems(path, mark.names)
            folders[make_absolute(path)] = option
        if path.suffix.lower() != mark.suffix and mark.suffix:
            endings.append(f"{option} is {path}, expected a name ending in {mark.suffix}")
        for file in [path] if mark.names is None else [path / name for name in mark.names]:
            place = make_absolute(file)
            if place in owners:
                problems.append(f"{owners[place]} and {option} are both {file}, expected two files")
            owners[place] = option
    for place, option in owners.items():
        if place in folders:
            problems.append(f"{option} is the folder of {folders[place]}, expected a file")
        if above := [owners[folder] for folder in place.parents if folder in owners]:
            problems.append(f"{option} is below the file of {above[0]}, expected another folder")
    return problems or _find_overwritten(request, owners) or endings


def _find_overwritten(request: Any, outputs: dict[Path, str]) -> list[str]:
    """Report outputs that would replace a file that is read, or that is the robot's."""
    existing = {path: option for path, option in outputs.items() if path.is_file()}
    inputs = list(_list_inputs(request)) if existing else []
    makers = {option for option, _, mark in _list_marked(request, Written) if mark.made}
    problems = []
    for path, option in existing.items():
        found = [file for file in inputs if path.samefile(file.path)]
        if found and not (option in makers and all(file.made for file in found)):
            why = "is a file of the robot" if found[0].robot else "is read, too"
            problems.append(f"{option}: {shorten_path(path)} {why}, expected another file")
    return problems


@dataclass(frozen=True)
class _Input:
    path: Path
    robot: bool = False
    made: bool = False


def _list_inputs(request: Any) -> Iterator[_Input]:
    """List the files that a request names and that exist, then those of its robots."""
    names = list[str]()
    for _, value, mark in _list_marked(request, Read):
        if mark.robot:
            names.append(str(value or ""))
            continue
        values = value if isinstance(value, tuple) else (value,)
        words = [word for each in values for word in (str(each), *str(each).split(","))]
        yield from (_Input(path) for path in map(Path, words) if _is_file(path))
    for name in names:
        yield from _list_robot_files(name)


def _list_robot_files(name: str) -> Iterator[_Input]:
    """List the files of a robot; without a name, of all that are installed."""
    from robots.robot import ROBOTS_FOLDER, list_robots  # loads numpy: not for --help

    folder = ROBOTS_FOLDER / name if not name or name in list_robots() else Path(name)
    for path in filter(_is_file, folder.rglob("*")):
        made = path.parent.name in MADE_FOLDERS and path.suffix in MADE_SUFFIXES
        if made or path.name in ROBOT_FILES or path.suffix.lower() in ROBOT_SUFFIXES:
            yield _Input(path, robot=True, made=made)


def _list_marked(request: Any, kind: type) -> Iterator[tuple[str, Any, Any]]:
    """Yield option, value and mark of each field that has one of a kind and a value."""
    hints = hints_of(type(request))
    for field in fields(request):
        mark = next((each for each in list_notes(hints[field.name]) if type(each) is kind), None)
        value = getattr(request, field.name)
        is_left_out = value is None and mark != ROBOT
        if mark and not is_left_out and not (kind is Written and value == STANDARD_OUTPUT):
            yield name_option(field.name, hints[field.name]), value, mark


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a null byte
        return False


def shorten_path(path: Path) -> Path:
    """Return a path as one would type it: relative where it is below the current folder."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


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


def check_different(checksums: Iterable[tuple[str, str]]) -> None:
    """Refuse two files, by their names, with the same checksum."""
    known: dict[str, str] = {}
    for name, checksum in checksums:
        if checksum in known:
            raise BadInputError(f"{name} is the same as {known[checksum]}, expected other logs")
        known[checksum] = name
