"""Versions of what results depend on, by checksum: program, libraries and robot."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from humanoid_getup.engines.engine import EngineError
from robots import load_robot

PACKAGES = ("humanoid_getup", "drivers", "robots", "sim2real")
LIBRARIES = ("mujoco", "numpy", "scipy", "cma", "onnxruntime")
SUFFIXES = (".py", ".toml")
LEFT_OUT = ("unfinished", "__pycache__")
"""Folders of a robot on which no result depends."""


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
        """Find those of this process and of a robot by its name or folder, if any.

        Raises:
            ValueError: if there is no such robot.
        """
        checksum = hash_folder(load_robot(robot).folder) if robot else ""
        return cls(program=hash_program(), libraries=list_libraries(), robot=checksum)

    def check(self, found: Versions) -> None:
        """Compare with those of another process.

        Raises:
            EngineError: naming what differs.
        """
        names = [field.name for field in fields(self)]
        differing = [name for name in names if getattr(self, name) != getattr(found, name)]
        if differing:
            listed = ", ".join(
                f"{name} {getattr(found, name)} (expected {getattr(self, name)})"
                for name in differing
            )
            raise EngineError(
                f"a worker on {platform.node()} has another {listed}: install the same release and "
                "copy the same robot there, and start the worker again"
            )


@cache
def hash_program() -> str:
    """Compute a checksum of the source code of the four packages, and of the servos' table."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        for place in map(Path, (spec and spec.submodule_search_locations) or ()):
            files = _list_files(place)
            _add_files(digest, place, [file for file in files if file.suffix in SUFFIXES])
    return digest.hexdigest()[:16]


def list_libraries() -> str:
    """List Python, its machine's kind and the libraries that compute, with their versions."""
    found = [f"{name} {version(name)}" for name in LIBRARIES]
    return ", ".join([f"Python {platform.python_version()}", platform.machine(), *found])


def hash_folder(folder: Path) -> str:
    """Compute a checksum of a robot's folder."""
    digest = hashlib.sha256()
    _add_files(digest, folder, _list_files(folder))
    return digest.hexdigest()[:16]


def _list_files(folder: Path) -> list[Path]:
    """List files in the order of their names within the folder."""
    found = (path for path in folder.rglob("*") if path.is_file())
    kept = [path for path in found if not set(path.relative_to(folder).parts) & set(LEFT_OUT)]
    return sorted(kept, key=lambda path: path.relative_to(folder).parts)


def _add_files(digest: hashlib._Hash, folder: Path, files: Iterable[Path]) -> None:
    for path in files:
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
