"""Versions of what results depend on, by checksum: program, libraries and robot."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

from humanoid_getup.engines.executor import is_here
from robots import load_robot

PACKAGES = ("humanoid_getup", "drivers", "robots", "sim2real")
LIBRARIES = ("mujoco", "numpy", "scipy", "cma", "onnxruntime")
SUFFIXES = {".py", ".toml"}
LEFT_OUT = {"unfinished", "__pycache__"}
"""Folders of a robot on which no result depends."""

Piece = TypeVar("Piece")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class Versions:
    """What results depend on beside their recipe."""

    program: str
    """Checksum of the source code."""
    libraries: str
    """Python and the libraries that compute."""
    robot: str
    """Checksum of the robot's folder; "" for work in a folder that all share."""

    @classmethod
    def find(cls, robot: str) -> Versions:
        """Find those of this process and of a robot by its name or folder, if any."""
        found = [f"{name} {version(name)}" for name in LIBRARIES]
        return cls(
            program=hash_program(),
            libraries=", ".join(
                [f"Python {platform.python_version()}", platform.machine(), *found]
            ),
            robot=hash_folder(load_robot(robot).folder) if robot else "",
        )


def checked(
    work: Callable[[Piece], Result], executor: Executor, robot: str = ""
) -> Callable[[Piece], Result]:
    """Return work that a worker with another program, other libraries or another robot refuses."""
    if is_here(executor):
        return work
    return partial(_check_and_do, work, robot, Versions.find(robot))


def _check_and_do(
    work: Callable[[Piece], Result], robot: str, expected: Versions, piece: Piece
) -> Result:
    wanted, found = asdict(expected), asdict(_find_own(robot))
    differing = [
        f"{name} {found[name]} (expected {wanted[name]})"
        for name in wanted
        if wanted[name] != found[name]
    ]
    if differing:
        raise ValueError(
            f"a worker on {platform.node()} has another {', '.join(differing)}: install the "
            "same release and copy the same robot there, and start the worker again"
        )
    return work(piece)


_find_own = cache(Versions.find)


@cache
def hash_program() -> str:
    """Compute a checksum of the source code of the four packages, and of the servos' table."""
    root = Path(__file__).parents[2]
    return _hash(*(root / package for package in PACKAGES), suffixes=SUFFIXES)


def hash_folder(folder: Path) -> str:
    """Compute a checksum of a robot's folder."""
    return _hash(folder)


def _hash(*folders: Path, suffixes: set[str] | None = None) -> str:
    """Compute a checksum of files, in the order of their names within each folder."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.rglob("*"), key=lambda path: path.relative_to(folder).parts):
            name = path.relative_to(folder)
            is_kept = suffixes is None or path.suffix in suffixes
            if is_kept and path.is_file() and not LEFT_OUT & set(name.parts):
                digest.update(name.as_posix().encode())
                digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]
