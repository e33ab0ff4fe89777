"""Folder of a robot that pieces write into, which workers on other machines have to share."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from humanoid_getup.engines.engine import Engine
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.shared import EngineOptions
from humanoid_getup.motions.build import UNFINISHED
from robots import Robot


@dataclass(frozen=True, kw_only=True)
class SharedFolder:
    """The folder of a robot while pieces write into it."""

    folder: Path
    mark: Path | None
    """File in it that is there as long as the pieces are wanted; None on one machine."""

    def check(self) -> None:
        """Refuse another machine's folder of the same name.

        Raises:
            BadInputError: naming the machine.
        """
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
