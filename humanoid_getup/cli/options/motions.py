"""Options of `motions`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.cli.options.shared import JsonOption
from humanoid_getup.jobs.requests.files import WRITTEN
from humanoid_getup.jobs.requests.motions import NewKeysOptions
from humanoid_getup.jobs.requests.shared import (
    BodyOption,
    MotionName,
    RobotOption,
)
from humanoid_getup.jobs.requests.view import ViewOptions


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
