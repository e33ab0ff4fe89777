"""Spreads the pieces of a job over the engine of its request."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar
from uuid import uuid4

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.options import EngineOptions, RobotOption
from humanoid_getup.engines.engine import WORTH, Engine
from humanoid_getup.engines.executor import make_executor
from humanoid_getup.motions.build import UNFINISHED
from humanoid_getup.policy.onnx_policy import SUFFIX as POLICY
from humanoid_getup.scenes.named_scenes import SUFFIX as SCENE
from robots import Robot, list_robots

FILES = (SCENE, POLICY, ".npz")
HERE = {"engine": "local", "address": ""}
"""Engine in the request of a worker, which starts none."""
Request = TypeVar("Request", bound=RobotOption)


def starting(
    request: EngineOptions, pieces: int, worth: int = WORTH
) -> AbstractContextManager[Executor]:
    """Start the workers of a request's engine for a number of pieces."""
    return make_executor(request.engine, request.address, pieces=pieces, worth=worth)


def make_worker_request(kind: type[Request], request: Request, **changes: Any) -> Request:
    """Make the request that workers get: of the class that they know, with absolute paths.

    Args:
        kind: Its class; the request of a command line is of one made from that.
        request: The request.
        changes: Fields that no result depends on, as workers get them.
    """
    values = {field.name: getattr(request, field.name) for field in fields(kind)} | HERE | changes
    values["robot"] = make_robot_absolute(values["robot"])
    if "scene" in values:
        values["scene"] = make_absolute(values["scene"])
    return kind(**values)


def make_robot_absolute(robot: str) -> str:
    """Return a robot's name, or the absolute path of its folder."""
    return robot if robot in list_robots() else str(Path(robot).resolve())


def make_absolute(name: str) -> str:
    """Return the absolute path of a scene's, policy's or motion's file; a name as it is."""
    return str(Path(name).resolve()) if name.endswith(FILES) else name


@dataclass(frozen=True, kw_only=True)
class SharedFolder:
    """The folder of a robot while pieces write into it."""

    folder: Path
    mark: Path | None
    """File in it that is there as long as the pieces are wanted; None on one machine."""

    def check(self) -> None:
        """Refuse another machine's folder of the same name."""
        if self.is_released():
            raise BadInputError(
                f"{self.folder} of {platform.node()} is not the folder of this machine, expected "
                "one that all machines share: motions are written into it"
            )

    def is_released(self) -> bool:
        """Return whether the pieces are no longer wanted."""
        return self.mark is not None and not self.mark.exists()


@contextmanager
def sharing(robot: Robot, request: EngineOptions) -> Iterator[SharedFolder]:
    """Share a robot's folder with the workers of a request's engine, with a mark on several
    machines."""
    folder = robot.folder.resolve()
    if Engine.parse(request.engine, request.address).kind == "local":
        yield SharedFolder(folder=folder, mark=None)
        return
    mark = folder / UNFINISHED / f"shared_{uuid4().hex}"
    mark.parent.mkdir(exist_ok=True)
    mark.touch()
    try:
        yield SharedFolder(folder=folder, mark=mark)
    finally:
        mark.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # something unfinished is kept there
            mark.parent.rmdir()
