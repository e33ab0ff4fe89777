"""Files that a request reads and writes: none may be both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from humanoid_getup.commands.output_files import (
    find_file_problems,
    find_folder_problems,
    make_absolute,
)
from humanoid_getup.commands.values import list_notes, name_option
from robots.storage.validation import hints_of

STANDARD_OUTPUT = "-"
ROBOT_FILES = (
    *("robot.toml", "servos.toml", "keyframes.toml"),
    *("calibration.toml", "calibration.virtual.toml"),
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
