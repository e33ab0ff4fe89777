"""Spreads the pieces of a job over the engine of its request."""

from __future__ import annotations

from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from humanoid_getup.commands.options import EngineOptions, RobotOption
from humanoid_getup.engines.engine import WORTH
from humanoid_getup.engines.executor import make_executor
from humanoid_getup.policy.onnx_policy import SUFFIX as POLICY
from humanoid_getup.scenes.named_scenes import SUFFIX as SCENE
from robots import list_robots

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
