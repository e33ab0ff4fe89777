"""Options of `motions`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.commands.backend_options import ViewOptions
from humanoid_getup.commands.files import WRITTEN, Written
from humanoid_getup.commands.options import (
    BodyOption,
    JsonOption,
    MotionName,
    RobotOption,
)
from humanoid_getup.jobs.requests.motions import NewKeysOptions, PlanRequest

PATH, STRIP = "path.npz", "strip.png"
PLAN_FILES = (PATH, STRIP)


@dataclass(frozen=True, kw_only=True)
class Plan(JsonOption, PlanRequest):
    """Plan a path from a lying posture to a stored motion, or to any posture; no physics."""

    keep_partial: bool = False
    """If no path is found, save the collision-free beginning of the best one."""
    out: Annotated[Path | None, Written(PLAN_FILES), arg(metavar="DIR")] = None
    """Folder for path.npz and strip.png."""

    def find_problems(self) -> list[str]:
        """Report --keep-partial without a folder as well."""
        problems = super().find_problems()
        if self.keep_partial and self.out is None:
            problems.append("--keep-partial: expected --out DIR with it, to save the path in")
        return problems


@dataclass(frozen=True, kw_only=True)
class ListMotions(BodyOption, JsonOption, RobotOption):
    """List a robot's rising motions."""


@dataclass(frozen=True, kw_only=True)
class ShowMotion(BodyOption, RobotOption):
    """Draw a rising motion as a film strip."""

    motion: Positional[MotionName]
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write; default: MOTION.png."""


@dataclass(frozen=True, kw_only=True)
class RecordMotion(NewKeysOptions, ViewOptions):
    """Record keys from a robot that is moved by hand, torque off.

    Enter or space takes the posture, backspace drops the last one, q finishes.
    """

    name: Positional[str]
    """Name of the new motion."""
