"""Versions of what results depend on, by checksum: program, libraries and robot."""

from __future__ import annotations

import hashlib
import platform
from dataclasses import dataclass, fields
from functools import cache
from importlib.metadata import version
from pathlib import Path

from humanoid_getup.engines.engine import EngineError
from robots import load_robot

PACKAGES = ("humanoid_getup", "drivers", "robots", "sim2real")
LIBRARIES = ("mujoco", "numpy", "scipy", "cma", "onnxruntime")
SUFFIXES = {".py", ".toml"}
LEFT_OUT = {"unfinished", "__pycache__"}
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
        found = [f"{name} {version(name)}" for name in LIBRARIES]
        return cls(
            program=hash_program(),
            libraries=", ".join(
                [f"Python {platform.python_version()}", platform.machine(), *found]
            ),
            robot=hash_folder(load_robot(robot).folder) if robot else "",
        )

    def check(self, found: Versions) -> None:
        """Compare with those of a worker.

        Raises:
            EngineError: naming what differs.
        """
        names = [field.name for field in fields(self)]
        differing = [
            f"{name} {getattr(found, name)} (expected {getattr(self, name)})"
            for name in names
            if getattr(self, name) != getattr(found, name)
        ]
        if differing:
            raise EngineError(
                f"a worker on {platform.node()} has another {', '.join(differing)}: install the "
                "same release and copy the same robot there, and start the worker again"
            )


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
