"""Request to list scenes, and to draw them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.jobs.requests.files import READ, WRITTEN
from humanoid_getup.jobs.requests.shared import BodyOption, RobotOption, Seed


@dataclass(frozen=True, kw_only=True)
class ScenesRequest(BodyOption, RobotOption):
    """List the scenes in which a robot may lie, or draw them."""

    scene: Annotated[Positional[str], READ] = ""
    """Name of a scene, or a scene file (.toml); default: all named scenes."""
    seed: Seed = 0
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write of a robot that lies in each scene; of one scene alone, in each of its
    ways."""
